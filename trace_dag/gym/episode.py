"""One run of a crash, taken step by step from outside.

A back-end runs a simulation to its end and asks its drivers as it goes. Here it runs in a greenlet: when a driver is
asked, control returns to the caller of :meth:`Episode.step`, and the run continues with the next action. So every
back-end can be stepped in one thread, and equal actions give results bit for bit as in an evaluation.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

from greenlet import GreenletExit, getcurrent, greenlet

from trace_dag.agents.evaluation.agents import Motion, Observation, Recorded
from trace_dag.agents.evaluation.evaluate import AFTER_CONTACT_S, LEAST_RATE_HZ, others_of
from trace_dag.agents.evaluation.loop import MotionController
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.scenario.cases import Case, Scenario
from trace_dag.scenario.progress import Arrival, RecordedWay
from trace_dag.simulation.driving import BodyState, Driver, Pace, Pedals
from trace_dag.simulation.types import Simulation, SimulationLog

Act = Motion | Recorded
States = Mapping[int, BodyState]


@dataclass(frozen=True)
class EpisodeMoment:
    """The time since the scenario began (s), and the true states of all parties by number."""

    time_s: float
    states: States


class _Seat:
    """A driver's place; a :class:`trace_dag.simulation.driving.Driver`."""

    def __init__(self, episode: Episode, number: int, scenario: Scenario, sensor: Sensor) -> None:
        self.period_s = scenario.period_s
        self.scenario = scenario
        self.sensor = sensor
        self._episode = episode
        self._number = number
        self._controller = MotionController(scenario)
        self.seen: tuple[float, Observation] | None = None
        self._arrival = Arrival(episode.case, number, RecordedWay(episode.case, number))

    @property
    def has_arrived(self) -> bool:
        """See :class:`trace_dag.simulation.driving.Driver`."""
        return self._arrival.reached

    def drive(self, time_s: float, states: States) -> Pedals | Pace | None:
        """See :class:`trace_dag.simulation.driving.Driver`."""
        self._arrival.look(time_s, states)
        act = self._episode.asked(EpisodeMoment(time_s, dict(states)))[self._number]
        if isinstance(act, Recorded):
            return Pace(act.pace)
        return self._controller.pedals(act, self.observe(EpisodeMoment(time_s, states)).own)

    def observe(self, moment: EpisodeMoment) -> Observation:
        """Return the observation at a moment; a sensor's noise is drawn only once for each moment."""
        if self.seen is None or self.seen[0] != moment.time_s:
            self.seen = moment.time_s, self.sensor.observe(moment.time_s, moment.states)
        return self.seen[1]


class Episode:
    """A case with some vehicles, ``egos``, driven from outside every ``period_s``; ``seed`` is that of the sensors.

    With reactive ``traffic`` the others keep their distance from the ego, with persistent traffic they keep its
    conflict, as in an evaluation. They observe at least :data:`trace_dag.agents.evaluation.evaluate.LEAST_RATE_HZ`
    times a second, even if the ego acts less often. A run without a contact ends once every ego has arrived, at the
    latest after twice the recorded time.
    """

    def __init__(
        self,
        case: Case,
        egos: tuple[int, ...],
        simulation: Simulation,
        *,
        period_s: float,
        sensing: Sensing,
        seed: int,
        traffic: Traffic = Traffic.RECORDED,
    ) -> None:
        self.case = case
        self.log: SimulationLog | None = None
        self.moment: EpisodeMoment | None = None
        self._simulation = simulation
        self._acts: Mapping[int, Act] = {}
        self._seats = {
            number: _Seat(
                self,
                number,
                case.scenario(number, period_s=period_s, seed=seed),
                Sensor(number, case.bodies, sensing, zlib.crc32(f"{seed}:{number}".encode())),
            )
            for number in egos
        }
        self._others: Mapping[int, Driver] = {}
        if traffic is not Traffic.RECORDED:
            (ego,) = egos
            self._others = others_of(case, ego, traffic, period_s=1 / LEAST_RATE_HZ, seed=seed)
        self._running = greenlet(self._simulate)
        self._resume()

    @property
    def over(self) -> bool:
        """Return whether the run has ended, which sets :attr:`log`."""
        return self.log is not None

    def scenario(self, ego: int) -> Scenario:
        """Return the scenario of a vehicle's driver."""
        return self._seats[ego].scenario

    def observe(self, ego: int) -> Observation:
        """Return the observation of a vehicle's driver now."""
        assert self.moment is not None
        return self._seats[ego].observe(self.moment)

    def step(self, acts: Mapping[int, Act]) -> None:
        """Continue with these actions, by vehicle, until the next observation or the end of the run."""
        self._acts = acts
        self._resume()

    def close(self) -> None:
        """Abandon a run that has not ended."""
        if self._running:
            self._running.parent = getcurrent()
            self._running.throw(GreenletExit)

    def asked(self, moment: EpisodeMoment) -> Mapping[int, Act]:
        """Return the actions for a moment; the first seat to ask hands control to the caller."""
        if self.moment is None or moment.time_s != self.moment.time_s:
            self.moment = moment
            caller = self._running.parent
            assert caller is not None, "a run is resumed by somebody"
            caller.switch()
        return self._acts

    def _resume(self) -> None:
        self._running.parent = getcurrent()
        self._running.switch()
        if self.log is not None:
            self.moment = _last_moment(self.log)

    def _simulate(self) -> None:
        self.log = self._simulation.run(
            self.case.going_on,
            time_limit_s=max(RecordedWay(self.case, number).limit_s for number in self._seats),
            drivers={**self._seats, **self._others},
            after_contact_s=AFTER_CONTACT_S,
            objects=self.case.objects,
        )


def _last_moment(log: SimulationLog) -> EpisodeMoment:
    states = {
        each.number: BodyState(
            each.number,
            *(
                float(values[-1])
                for values in (
                    each.x_m,
                    each.y_m,
                    each.z_m,
                    each.heading_rad,
                    each.velocity_x_mps,
                    each.velocity_y_mps,
                    each.yaw_rate_rps,
                )
            ),
        )
        for each in log.vehicles
    }
    return EpisodeMoment(log.duration_s, states)
