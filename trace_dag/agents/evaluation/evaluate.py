"""One evaluation: a case, a participant, an agent, and how it sees; a run in a back-end, measured."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

from trace_dag.agents.evaluation.agents import Agent, AgentFault
from trace_dag.agents.evaluation.loop import AgentDriver
from trace_dag.agents.evaluation.metrics import DriveOutcome, Metrics, measure, outcome_of
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.agents.evaluation.persistent import persistent_drivers
from trace_dag.agents.evaluation.rejudging import drive_of
from trace_dag.agents.evaluation.traffic import Traffic, reactive_drivers
from trace_dag.common.errors import UserError
from trace_dag.scenario.cases import Case
from trace_dag.scenario.progress import Arrival, RecordedWay
from trace_dag.simulation.driving import Driver
from trace_dag.simulation.types import Simulation, SimulationLog

LEAST_RATE_HZ, MOST_RATE_HZ = 20.0, 100.0
AFTER_CONTACT_S = 0.5
"""A run goes on for so long after the first contact: its delta-v is known a quarter of a second after it."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of an evaluation: rate of actions (20 to 100 Hz), sensing, seed of the noise, and traffic.

    Raises :class:`UserError` for a rate out of bounds.
    """

    rate_hz: float = 20.0
    sensing: Sensing = field(default_factory=Sensing)
    seed: int = 1
    traffic: Traffic = Traffic.RECORDED

    def __post_init__(self) -> None:
        if not LEAST_RATE_HZ <= self.rate_hz <= MOST_RATE_HZ:
            raise UserError(
                f"a rate of {self.rate_hz:g} Hz; agents act {LEAST_RATE_HZ:g} to {MOST_RATE_HZ:g} times a second"
            )

    @property
    def suffix(self) -> str:
        """Return the suffix of a file's name that identifies these conditions; empty for the default ones."""
        usual, sensing = Conditions(), self.sensing
        parts = (
            (self.rate_hz != usual.rate_hz, f"{self.rate_hz:g}hz"),
            (sensing.range_m != usual.sensing.range_m, f"range{sensing.range_m:g}"),
            (sensing.noise_m != usual.sensing.noise_m, f"noise{sensing.noise_m:g}"),
            (sensing.occlusion, "occlusion"),
            (self.seed != usual.seed, f"seed{self.seed}"),
            (self.traffic is not usual.traffic, str(self.traffic)),
        )
        return "".join(f"-{part}" for is_unusual, part in parts if is_unusual)


@dataclass(frozen=True)
class Evaluation:
    """The result of one agent in one case. If it is faulty, ``metrics`` is None and ``fault`` has the reason.

    ``role``: of the two parties that collided first, ``striking`` closed in faster and ``struck`` is the other;
    ``departing`` left the road by itself. ``part`` is initiator or responder, None if the report does not say.
    ``drive``: the positions of all parties (:mod:`trace_dag.agents.evaluation.rejudging`).
    """

    case_id: str
    key: str
    ego: int
    role: str
    outcome: DriveOutcome
    metrics: Metrics | None = None
    fault: str = ""
    part: str | None = None
    drive: str = ""


def evaluate(case: Case, ego: int, agent: Agent, conditions: Conditions, simulation: Simulation) -> Evaluation:
    """Run a case with an agent at the wheel of participant ``ego`` and measure it. A fault of the agent is a result."""
    after_contact_s = AFTER_CONTACT_S if case.departed is None else None  # it may overturn later
    try:
        log = run(case, ego, agent, conditions, simulation, after_contact_s=after_contact_s)
    except AgentFault as fault:
        return faulty(case, ego, str(fault))
    metrics = measure(case, ego, log)
    outcome = outcome_of(metrics, departed=case.departed is not None)
    part, drive = case.parts.get(ego), drive_of(log)
    return Evaluation(case.case_id, case.key, ego, case.role(ego), outcome, metrics, part=part, drive=drive)


def faulty(case: Case, ego: int, fault: str) -> Evaluation:
    """Return the result of an agent that broke its side of the interface."""
    return Evaluation(
        case.case_id, case.key, ego, case.role(ego), DriveOutcome.FAULTY, fault=fault, part=case.parts.get(ego)
    )


def others_of(case: Case, ego: int, traffic: Traffic, *, period_s: float, seed: int) -> dict[int, Driver]:
    """Return drivers, by number, for all parties but the agent that do more than follow the recording."""
    if traffic is Traffic.REACTIVE:
        return reactive_drivers(case, ego, period_s=period_s, seed=seed)
    return persistent_drivers(case, ego, period_s=period_s) if traffic is Traffic.PERSISTENT else {}


def run(
    case: Case,
    ego: int,
    agent: Agent,
    conditions: Conditions,
    simulation: Simulation,
    *,
    after_contact_s: float | None = None,
) -> SimulationLog:
    """Return the log of a case with an agent at the wheel.

    It ends at rest, or ``after_contact_s`` after the first contact. Raises :class:`AgentFault`.
    """
    seed = zlib.crc32(f"{conditions.seed}:{case.case_id}:{ego}".encode())
    scenario = case.scenario(ego, period_s=1 / conditions.rate_hz, seed=seed)
    way = RecordedWay(case, ego)
    sensor = Sensor(ego, case.bodies, conditions.sensing, seed)
    drivers = others_of(case, ego, conditions.traffic, period_s=scenario.period_s, seed=seed)
    drivers[ego] = AgentDriver(agent, scenario, sensor, Arrival(case, ego, way))
    return simulation.run(
        case.going_on, time_limit_s=way.limit_s, drivers=drivers, after_contact_s=after_contact_s, objects=case.objects
    )
