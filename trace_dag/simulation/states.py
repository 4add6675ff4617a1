"""The types of an estimate: participants with poses, speeds and a timed trajectory, for one or several hypotheses.

Frame: the local frame of the crash; positions are of the body's centre. Time 0 is the start of the reconstruction,
``impact_time_s`` the planned first contact.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator, ValidationError

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.trailer import Trailer
from trace_dag.roads.map.model import LaneMatch
from trace_dag.simulation.objects import FixedObject


class Manoeuvre(StrEnum):
    """Manoeuvres of vehicles from the initial lane to the crash, and movements of people and animals."""

    STRAIGHT = "straight"
    CURVE = "curve"
    TURN_LEFT = "turn_left"
    TURN_RIGHT = "turn_right"
    U_TURN = "u_turn"
    LANE_CHANGE_LEFT = "lane_change_left"
    LANE_CHANGE_RIGHT = "lane_change_right"
    MERGE = "merge"
    PASS = "pass"  # noqa: S105 - the manoeuvre
    CROSS_CENTRELINE = "cross_centreline"
    WRONG_WAY = "wrong_way"
    STOPPED = "stopped"
    STARTING = "starting"
    BACKING = "backing"
    ENTER_FROM_DRIVEWAY = "enter_from_driveway"
    LEAVE_ROAD = "leave_road"
    CROSS_FROM_LEFT = "cross_from_left"  # from here on: people, seen from the vehicle that strikes them
    CROSS_FROM_RIGHT = "cross_from_right"
    GO_ALONG = "go_along"
    COME_TOWARDS = "come_towards"
    STAND = "stand"


class SpeedSource(StrEnum):
    """Sources of initial speeds.

    A reported speed is never changed.
    """

    REPORTED = "reported"
    INFERRED_LIMIT = "inferred_limit"
    INFERRED_MANOEUVRE = "inferred_manoeuvre"
    INFERRED_CLASS = "inferred_class"
    INFERRED_GAIT = "inferred_gait"  # of a person


def _as_array(values: object) -> FloatArray:
    return np.asarray(values, dtype=float)


Series = Annotated[
    FloatArray,
    PlainValidator(_as_array, json_schema_input_type=list[float]),
    PlainSerializer(lambda values: values.tolist(), return_type=list[float]),
]
"""Numbers over time: an array in memory, a list in JSON."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A planned motion, arrays of equal length n: it goes on past the impact as if nothing had happened.

    ``heading_rad`` is the body's heading; backing vehicles have negative ``speed_mps``.
    """

    time_s: Series
    x_m: Series
    y_m: Series
    z_m: Series
    heading_rad: Series
    speed_mps: Series


@dataclass(frozen=True)
class LossOfControl:
    """The assumed loss of control of a vehicle from a time on.

    Its cause (the driver, damage, or a trip) is not reported.

    Its front wheels are turned to the left (``wheels_rad``; right: negative). It spins (``yaw_rps``, added to its yaw
    rate), as after an eccentric strike. ``locked_wheels`` carry that share of its weight: with 0 it rolls on, with 1 it
    slides; None uses the settings. Wheels that dig in (``digs_in``) resist sideways as in soil, also on pavement, as
    gouging rims do; they catch at the kerb of a street.
    """

    from_s: float
    wheels_rad: float = 0.0
    yaw_rps: float = 0.0
    locked_wheels: float | None = None
    digs_in: bool = False


@dataclass(frozen=True, eq=False)
class ParticipantState:
    """One party of a hypothesis: its body, impact and initial state, and the motion between them.

    ``vehicle_number`` is the party's: FARS ``VEH_NO``, 1000 + ``PER_NO`` for a person, 2000 + the event for an
    animal. For a person ``height_m`` is the stature, for an animal the height at the withers; ``mass_kg`` includes a
    cycle or the like, and ``vehicle_class`` has no meaning. All values of a combination vehicle are those of the
    pulling vehicle; ``trailer_heading_rad`` is the trailer's heading at the trajectory's times."""

    vehicle_number: int
    vehicle_class: VehicleClass
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    manoeuvre: Manoeuvre
    initial_pose: Pose
    initial_speed_mps: float
    impact_pose: Pose
    impact_speed_mps: float
    speed_source: SpeedSource
    trajectory: Trajectory
    initial_lane: LaneMatch | None = None
    impact_lane: LaneMatch | None = None
    impact_clock_h: float | None = None  # planned contact on this body
    braking: bool = False  # it loses speed before the impact
    kind: PartyKind = PartyKind.MOTOR_VEHICLE
    drives_on: bool = False  # after striking a person: the record says that the driver left
    skids_from_s: float | None = None  # out of control from then on: it moves along the trajectory whatever its heading
    # What the report has it do after a contact is off the road: the ground there, and rolling over, are simulated.
    beyond_edge: Annotated[bool, Field(exclude_if=lambda beyond: not beyond)] = False
    breaks_rail: Annotated[bool, Field(exclude_if=lambda breaks: not breaks)] = False
    losses_of_control: Annotated[tuple[LossOfControl, ...], Field(exclude_if=lambda lost: not lost)] = ()
    trailer: Annotated[Trailer | None, Field(exclude_if=lambda trailer: trailer is None)] = None
    trailer_heading_rad: Annotated[Series | None, Field(exclude_if=lambda heading: heading is None)] = None

    @property
    def is_figure(self) -> bool:
        """Return whether the party is simulated as a jointed figure: a person outside motor vehicles, or an animal."""
        return self.kind is not PartyKind.MOTOR_VEHICLE


@dataclass(frozen=True)
class PlannedEvent:
    """A planned contact of two parties: the number of the record's event, time (s) and place."""

    event_number: int
    party_1: int
    party_2: int
    time_s: float
    xy_m: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One possible course of the crash.

    It has participants (driving vehicles, people) and their planned contacts, in order. ``score`` is a log-likelihood
    of the record's evidence, by term in ``evidence``.
    """

    name: str
    score: float
    evidence: dict[str, float]
    participants: tuple[ParticipantState, ...]
    impact_time_s: float
    impact_point_xy_m: tuple[float, float]
    checks: tuple[EstimateCheck, ...] = ()
    planned: tuple[PlannedEvent, ...] = ()  # strikes of persons, in order; a collision of two vehicles has none
    later_events: tuple[EstimateCheck, ...] = ()  # what came of the later objects and overturns
    objects: tuple[FixedObject, ...] = ()  # beside the road, in the order of their events; planned or struck afterwards


@dataclass(frozen=True)
class EstimateCheck:
    """One check of a hypothesis (inside road, heading as reported, speed plausible, path exists, ...)."""

    name: str
    passed: bool
    detail: str = ""


@dataclass(frozen=True)
class EstimatorRun:
    """Provenance of an estimate: its estimator, and for LLMs model, prompt version, attempts, tokens, cost, answers.

    ``estimator`` made it. For a fallback, ``fallback_from`` names the requested estimator and ``fallback_reason`` the
    reason; model, attempts, cost and answers are then those of the requested one.
    """

    estimator: str
    version: str
    model: str | None = None
    prompt_version: str | None = None
    attempts: int = 1
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0
    latency_s: float = 0.0
    fallback_from: str | None = None
    fallback_reason: str = ""
    answers: tuple[dict[str, object], ...] = field(default=())

    @property
    def fallback(self) -> bool:
        """Return whether an estimator other than the requested one made the estimate."""
        return self.fallback_from is not None

    def in_words(self) -> str:
        """Return the estimator's name, and, if it was not the asked one, why."""
        made = f"{self.estimator} estimator"
        if self.fallback_from is None:
            return f"{made} ({self.model})" if self.model else made
        return f"{made}, in place of the {self.fallback_from} estimator: {self.fallback_reason}"


@dataclass(frozen=True)
class PartyDraw:
    """One party of a draw: unsigned speeds (m/s), and distance from its planned place at the impact (metres)."""

    number: int
    travel_mps: float
    impact_mps: float
    ahead_m: float
    left_m: float
    mass_kg: float


@dataclass(frozen=True)
class Sample:
    """A draw: hypothesis by index, friction and reaction time as shares of the planned ones, and parties."""

    hypothesis: int
    friction: float
    parties: tuple[PartyDraw, ...]
    reaction: float


@dataclass(frozen=True, eq=False)
class StateEstimate:
    """All hypotheses of one crash, best first, at least one; the ones after the first are runners-up."""

    key: str
    hypotheses: tuple[Hypothesis, ...]
    run: EstimatorRun
    ambiguity: float = 0.0  # posterior probability of the sides that the best does not come from, 0 to 1
    samples: tuple[Sample, ...] = ()  # draws of what the report leaves open

    @property
    def best(self) -> Hypothesis:
        """Return the hypothesis with the highest score."""
        return self.hypotheses[0]


# --- stored -----------------------------------------------------------------------------------------------------------
def estimate_to_json(estimate: StateEstimate) -> bytes:
    """Return the estimate as UTF-8 JSON, ending with a newline: the same bytes for the same estimate.

    >>> estimate_from_json(estimate_to_json(state_estimate)).key
    '2023-319003'
    """
    return json_adapter(StateEstimate).dump_json(estimate) + b"\n"


def run_to_json(run: EstimatorRun) -> bytes:
    """Return the run of an estimator without an estimate, as UTF-8 JSON, ending with a newline."""
    return json_adapter(EstimatorRun).dump_json(run, indent=1) + b"\n"


def estimate_from_json(data: bytes, *, name: str = "state estimate") -> StateEstimate:
    """Read an estimate written by :func:`estimate_to_json`.

    Raises :class:`Failure`, which names the file ``name``, for other content.

    >>> estimate_from_json(estimate_to_json(state_estimate)).hypotheses[0].participants[0].vehicle_number
    1
    """
    try:
        return json_adapter(StateEstimate).validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the document"
        raise Failure(
            f"{name}: not a state estimate: {where}: {first['msg']}; delete the file and run the stage again"
        ) from error
