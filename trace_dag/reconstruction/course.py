"""The crash as planned so far, its simulation, and the search for further plans.

Estimators look ahead with the embedded back-end and its default settings. The settings of a run are not used, because
an estimate must follow from the record and the map alone.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

from trace_dag.common.settings import SimSettings
from trace_dag.crash.event_sequence import CrashEvent, EventSequence
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.crash_run import CrashRun
from trace_dag.simulation.embedded import EmbeddedBackend, EmbeddedSimulation
from trace_dag.simulation.matching import Matching, SimulatedEvent, expect_events, happenings, happenings_of, match
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.run import participant, surface_friction
from trace_dag.simulation.states import LossOfControl, ParticipantState
from trace_dag.simulation.types import Contact, SimulationLog

_States: TypeAlias = tuple[ParticipantState, ...]
DEFAULTS: Final = SimSettings()
_MOST: Final = 55  # simulations of a crash, after which nothing else is tried


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan for an event: its parties, its objects, and the log-likelihood.

    ``detail`` is a text on its assumptions. Plans of one ``group`` differ only in detail.
    """

    states: tuple[ParticipantState, ...]
    objects: tuple[FixedObject, ...] = ()
    name: str = ""
    score: float = 0.0
    evidence: Mapping[str, float] = field(default_factory=dict)
    group: Hashable = None
    detail: str = ""


@dataclass(frozen=True, eq=False)
class Course:
    """The crash so far: its parties, objects, simulated log, and the events planned so far.

    ``run`` is the unfinished simulation of ``log``, or None after its end.
    """

    states: tuple[ParticipantState, ...]
    objects: tuple[FixedObject, ...]
    run: CrashRun | None
    log: SimulationLog
    events: tuple[CrashEvent, ...]
    matching: Matching
    score: float
    names: tuple[str, ...]
    evidence: Mapping[str, float]

    @property
    def numbers(self) -> frozenset[int]:
        """Return the numbers of the parties that take part."""
        return frozenset(state.vehicle_number for state in self.states)

    @property
    def rank(self) -> tuple[int, int, float]:
        """Return the sorting key: more events that happen, fewer unreported contacts, higher likelihood."""
        return -self.matching.happened, len(self.matching.strange), -round(self.score, 6)

    @property
    def comes_right(self) -> bool:
        """Return whether every required event happens, and no unreported contact."""
        needed = zip(self.matching.matched, expect_events(self.events), strict=True)
        return not self.matching.strange and all(seen is not None or not each.required for seen, each in needed)

    def release(self) -> None:
        """Release the run of a course that is not gone on with."""
        if self.run is not None:
            self.run.release()

    def state_of(self, number: int) -> ParticipantState:
        """Return the state of a party that takes part."""
        return next(each for each in self.states if each.vehicle_number == number)

    def last_event_s(self, number: int) -> float | None:
        """Return the time of a party's last planned event; None without one.

        Repeated touches, as bodies come to rest against each other, do not count.
        """
        seen = (each for each in self.matching.matched if each is not None and number in each.pair)
        return max((each.time_s for each in seen), default=None)


@dataclass(eq=False)
class Search:
    """The fixed facts of a search: the scene, the events, and the simulation for looking ahead.

    ``simulated`` counts simulations so far; after ``enough`` only what was begun is gone on with.
    """

    scene: Scene
    sequence: EventSequence
    simulation: EmbeddedSimulation
    lead_s: float
    simulated: int = 0
    enough: int = _MOST
    # By the log of a course, which follows from its states and objects, and who loses control of it: what it comes to.
    _lost: dict[tuple[SimulationLog, int, tuple[LossOfControl, ...]], tuple[_States, SimulationLog]] = field(
        default_factory=dict
    )

    @property
    def has_enough(self) -> bool:
        """Return whether so much was simulated that only what was begun is gone on with."""
        return self.simulated >= min(self.enough, _MOST)

    @property
    def is_over(self) -> bool:
        """Return whether so much was simulated that no other course is tried."""
        return self.simulated >= _MOST

    def course(
        self,
        plan: Plan,
        events: Sequence[CrashEvent],
        before: Course | None = None,
        tolerated: Sequence[SimulatedEvent] = (),
    ) -> Course:
        """Return a plan simulated to its end, or to a premature or unreported contact.

        Tolerated contacts do not end it.
        """
        usual = {each.pair for each in tolerated}
        expected, known = expect_events(events), self.sequence.order_known

        def comes_right(contacts: Sequence[Contact]) -> bool:
            strange = match(happenings(contacts), expected, order_known=known).strange
            return all(each.pair in usual for each in strange)

        self.simulated += 1
        run = self.simulation.begin(
            tuple(map(participant, plan.states)), time_limit_s=DEFAULTS.time_limit_s, objects=plan.objects
        )
        log = run.log(as_long_as=comes_right)
        ended = comes_right(log.contacts)
        if ended:
            run.release()
        return Course(
            plan.states,
            plan.objects,
            None if ended else run,
            log,
            tuple(events),
            self.matching(log, events),
            plan.score + (before.score if before else 0.0),
            (*(before.names if before else ()), *((plan.name,) if plan.name else ())),
            {**(before.evidence if before else {}), **plan.evidence},
        )

    def with_event(self, course: Course, event: CrashEvent) -> Course:
        """Return the course with one more event to happen."""
        events = tuple(each for each in self.sequence.events if each in course.events or each is event)
        return replace(course, events=events, matching=self.matching(course.log, events))

    def changed(self, course: Course, state: ParticipantState) -> Course:
        """Return the course with another state of one party."""
        assert state.losses_of_control
        key = course.log, state.vehicle_number, state.losses_of_control
        if key not in self._lost:
            states = tuple(state if s.vehicle_number == state.vehicle_number else s for s in course.states)
            parties = tuple(map(participant, states))
            self.simulated += 1
            log = self.simulation.run(parties, time_limit_s=DEFAULTS.time_limit_s, objects=course.objects)
            self._lost[key] = states, log
        states, log = self._lost[key]
        return replace(course, states=states, run=None, log=log, matching=self.matching(log, course.events))

    def to_the_end(self, course: Course) -> Course:
        """Return the course simulated on to the rest of all parties, whatever contacts occur."""
        if course.run is None:
            return course
        log = course.run.log()
        course.run.release()
        return replace(course, run=None, log=log, matching=self.matching(log, course.events))

    def matching(self, log: SimulationLog, events: Sequence[CrashEvent]) -> Matching:
        """Return the events in a simulation."""
        return match(happenings_of(log), expect_events(events), order_known=self.sequence.order_known)


def default_simulation(network: RoadNetwork, record: CrashRecord) -> EmbeddedSimulation:
    """Return the map made ready, with the grip that the record's surface has."""
    return EmbeddedBackend(DEFAULTS).load(network, b"", friction=surface_friction(DEFAULTS, record))
