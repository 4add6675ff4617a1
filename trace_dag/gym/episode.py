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
from trace_dag.agents.evaluation.metrics import Metrics
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.units import GRAVITY_MPS2
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
        return self._arrival.reached

    def drive(self, time_s: float, states: States) -> Pedals | Pace | None:
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


# --- reward ----------------------------------------------------------------------------------------------------------
_LEAST_DELTA_V_MPS = 1.0
_WORST = 2.0


@dataclass(frozen=True)
class Reward:
    """Weights of the reward.

    During a run an agent gets shares of ``progress`` for the distance driven, up to the recorded distance; standing
    still gives none. At the end it gets ``avoided`` if no parties touched and it finished within twice the recorded
    time (:mod:`trace_dag.scenario.progress`), else nothing. A contact costs ``contact`` times the ratio of its larger
    delta-v to that of the recorded crash (2 at most). It loses ``off_road`` and ``wrong_way`` for each second of these
    (1 at most of each), and ``comfort`` times its hardest braking in g.
    """

    avoided: float = 1.0
    contact: float = 1.0
    progress: float = 0.5
    off_road: float = 0.2
    wrong_way: float = 0.1
    comfort: float = 0.1

    def in_the_end(self, metrics: Metrics) -> float:
        """Return the reward of an episode beside its progress.

        >>> from dataclasses import replace
        >>> driven = Metrics(False, None, None, None, None, 0.0, 0.0, 8.0, 8.0, None, None, 0.0, 0.0, 0.0, 0, 0.0, 0, 0)
        >>> driven = replace(driven, finished=True)
        >>> Reward().in_the_end(driven)
        1.0
        >>> Reward().in_the_end(replace(driven, collided=True, delta_v_mps=4.0, off_road_s=2.0))
        -0.9
        >>> Reward().in_the_end(replace(driven, finished=False))
        0.0
        """
        if metrics.collided:
            worth = -self.contact * min(
                metrics.delta_v_mps / max(metrics.recorded_delta_v_mps, _LEAST_DELTA_V_MPS), _WORST
            )
        else:
            worth = self.avoided if metrics.finished else 0.0
        worth -= min(self.off_road * metrics.off_road_s, 1.0) + min(self.wrong_way * metrics.wrong_way_s, 1.0)
        return worth - self.comfort * metrics.max_deceleration_mps2 / GRAVITY_MPS2

    def on_the_way(self, driven_m: float, before_m: float, recorded_m: float) -> float:
        """Return the reward of a step from ``before_m`` to ``driven_m``.

        ``recorded_m`` is the whole distance driven in the recorded crash.
        """
        whole = max(recorded_m, 1.0)
        return self.progress * (min(driven_m / whole, 1.0) - min(before_m / whole, 1.0))
