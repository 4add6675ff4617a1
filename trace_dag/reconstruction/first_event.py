"""First harmful events: the choice of the planner by kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import StateSettings
from trace_dag.crash.departure_side import SIDE_OF_EVENT
from trace_dag.crash.event_sequence import CrashEvent, EventSequence
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import departure_of
from trace_dag.reconstruction.alternatives import ambiguity_of
from trace_dag.reconstruction.analytic_hypotheses import first_contact
from trace_dag.reconstruction.planners.parked import parked_contacts
from trace_dag.reconstruction.planners.pedestrian import strike_hypotheses
from trace_dag.reconstruction.planners.rollover import overturn_hypotheses
from trace_dag.reconstruction.planners.run_off_road.planner import departure_hypotheses
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.states import Hypothesis

_BELOW_BRIDGES: Final = frozenset({3, 17, 19, 32, 34, 35, 36, 37, 41, 42})
"""SOE of what is on the ground and on no bridge, from water and boulders to trees: who came to it broke the rail."""
_STOOD_THERE: Final = frozenset({8, 9, 14, 15})
"""SOE of people and of parked vehicles: where they stood beside the road no rail was before them."""


@dataclass(frozen=True, eq=False)
class FirstEvent:
    """The ranked hypotheses of a first event, best first, at least one, and how unsure the best is (0 to 1)."""

    hypotheses: tuple[Hypothesis, ...]
    ambiguity: float

    @classmethod
    def of(cls, hypotheses: tuple[Hypothesis, ...]) -> FirstEvent:
        """Return hypotheses whose scores say how unsure the best is."""
        return cls(hypotheses, ambiguity_of(hypotheses))


@dataclass(frozen=True, eq=False)
class FirstScene:
    """The ground for planning a first event.

    Scene, sequence, simulation to look ahead with, lead before it (s), and number of hypotheses wanted.
    """

    scene: Scene
    sequence: EventSequence
    simulation: EmbeddedSimulation
    settings: StateSettings
    most: int

    @property
    def event(self) -> CrashEvent:
        """Return the first event."""
        return self.sequence.first


Planner: TypeAlias = Callable[[FirstScene], FirstEvent]


def plan_first_event(of: FirstScene) -> FirstEvent:
    """Return the hypotheses of the first event.

    Raises :class:`Rejection` (``no_feasible_state``) where none lets it happen as reported.
    """
    found = _PLANNERS[of.event.kind](of)
    return replace(found, hypotheses=tuple(_off_bridges(of.scene.record, each) for each in found.hypotheses))


def _off_bridges(record: CrashRecord, hypothesis: Hypothesis) -> Hypothesis:
    """Mark vehicles that must break through a bridge rail, because the report places them below it."""
    gone: set[int | None] = set()
    left: set[int | None] = set()
    for event in record.events:
        if event.code in SIDE_OF_EVENT:
            left.add(event.party_1)
        elif event.code in _BELOW_BRIDGES or (event.code in _STOOD_THERE and event.party_1 in left):
            gone.add(event.party_1)
    states = tuple(replace(s, breaks_rail=True) if s.vehicle_number in gone else s for s in hypothesis.participants)
    return replace(hypothesis, participants=states)


def _vehicle_contact(of: FirstScene) -> FirstEvent:
    wanted = of.settings.model_copy(update={"max_hypotheses": of.most})
    if of.event.parked is None:
        return FirstEvent(*first_contact(of.scene, of.event, wanted))
    found = parked_contacts(of.scene, of.event, lead_time_s=of.settings.lead_time_s, most=of.most)
    if not found:
        one, two = of.event.pair
        detail = of.scene.no_way_that(f"lets vehicles {one} and {two} meet first, as event {of.event.number} says")
        raise Rejection(Reason.NO_FEASIBLE_STATE, detail, measured=0.0)
    return FirstEvent.of(found)


def _strike(of: FirstScene) -> FirstEvent:
    return FirstEvent.of(strike_hypotheses(of.scene, of.sequence, of.settings, most=of.most))


def _object(of: FirstScene) -> FirstEvent:
    departure = departure_of(of.scene.record, of.sequence)
    return FirstEvent.of(departure_hypotheses(of.scene, departure, lead_s=of.settings.lead_time_s, most=of.most))


def _overturn(of: FirstScene) -> FirstEvent:
    departure = departure_of(of.scene.record, of.sequence)
    found = overturn_hypotheses(of.scene, departure, of.simulation, lead_s=of.settings.lead_time_s, most=of.most)
    return FirstEvent.of(found)


_PLANNERS: Final[Mapping[EventKind, Planner]] = {
    EventKind.VEHICLE_CONTACT: _vehicle_contact,
    EventKind.PERSON_STRUCK: _strike,
    EventKind.ANIMAL_STRUCK: _strike,
    EventKind.OBJECT_STRUCK: _object,
    EventKind.OVERTURN: _overturn,
}
