"""Estimates against the truth: how far the states estimated for the bundled sample are from those it was made of.

Belongs here: reading ``truth.json`` (see ``data/sample/README.md``) and the errors of an estimate against it. Does not
belong here: running the crashes, or printing. Frame: the crash's local frame at its reported point, the one of both
sides.

The approach is judged without a road map: the truth carries the path each vehicle took, traced back well beyond its
initial pose, and how far the carriageway reaches to both sides of the lane. An initial pose lies in the right lane if
it is within half a lane of that path and points along it, on the right road if it is within the carriageway.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.units import wrap_angle
from trace_dag.flow.crash_status import Made, makers_in_words
from trace_dag.simulation.states import EstimatorRun, Hypothesis, ParticipantState, StateEstimate

MAX_APPROACH_HEADING_RAD = math.radians(60)
"""An initial pose that points further away from the true path came from elsewhere, or the other way."""


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class TruePose(_Row):
    """A body's centre and heading in the local frame."""

    x_m: float
    y_m: float
    heading_rad: float


class TruePoint(_Row):
    """A place in the local frame."""

    x_m: float
    y_m: float


class TrueApproach(_Row):
    """The lane a vehicle came in, from 1 at its driver's left, 0 a shared centre lane."""

    street: str
    lane_from_left: int
    lanes: int
    lane_width_m: float
    room_m: tuple[float, float]  # from the path to the carriageway's left and right edge, looking along it


class TrueVehicle(_Row):
    """The true course of one vehicle.

    ``path`` ends at the impact pose and begins before the initial one.
    """

    vehicle_number: int
    manoeuvre: str
    speed_reported: bool
    initial_pose: TruePose
    initial_speed_mps: float
    impact_pose: TruePose
    impact_speed_mps: float
    impact_clock_h: int
    approach: TrueApproach
    path: tuple[tuple[float, float], ...]


class Expectation(_Row):
    """The final state a crash must reach: ``verified``, or ``rejected`` for ``reason``."""

    final_state: str
    reason: str | None = None


class TrueCrash(_Row):
    """One crash of the sample; one that must be rejected has no vehicles."""

    key: str
    title: str
    expected: Expectation
    kind: str = "two_vehicles"
    impact_point: TruePoint | None = None
    vehicles: tuple[TrueVehicle, ...] = ()


class SampleTruth(_Row):
    """The file as a whole."""

    crashes: tuple[TrueCrash, ...]

    @property
    def by_key(self) -> dict[str, TrueCrash]:
        """Return crashes by partition key."""
        return {crash.key: crash for crash in self.crashes}


@dataclass(frozen=True)
class TruthRow:
    """One vehicle of one crash: its errors. ``None`` for all of them where there is no estimate of that vehicle.

    An unreported speed also shows in the heading and position errors of the initial pose; ``speed_reported`` tells
    those vehicles apart. Speeds are signed along the body, so a vehicle wrongly taken for backing up counts as an
    error.
    """

    key: str
    title: str
    vehicle_number: int
    manoeuvre: str
    street: str
    speed_reported: bool
    impact_point_error_m: float | None = None  # of the crash, the same for both of its vehicles
    heading_error_deg: float | None = None  # at the impact
    initial_heading_error_deg: float | None = None
    initial_speed_error_mps: float | None = None  # estimate minus truth
    impact_speed_error_mps: float | None = None
    initial_position_error_m: float | None = None
    approach_correct: bool | None = None
    lane_correct: bool | None = None
    estimated_manoeuvre: str | None = None
    estimator: str | None = None  # that made the estimate
    fallback_from: str | None = None  # the one asked, where that made none


@dataclass(frozen=True)
class TruthSummary:
    """The sample as a whole. Medians are over vehicles with an estimate, of the impact point over crashes.

    ``estimators`` has the number of estimates by each estimator, in words. Errors are of the asked estimator's own
    estimates; those another made in its place are counted in ``fallbacks`` alone.
    """

    crashes: int
    estimators: str
    estimated: int
    fallbacks: int
    approach_correct_share: float | None  # of the crashes estimated, both vehicles
    lane_correct_share: float | None
    median_impact_point_error_m: float | None
    median_heading_error_deg: float | None
    median_initial_position_error_m: float | None  # both speeds of the crash reported
    median_initial_position_error_unreported_m: float | None
    median_speed_error_reported_mps: float | None  # absolute
    outcomes_as_expected: int | None = None  # None: outcomes were not given
    outcomes: int | None = None


@dataclass(frozen=True)
class OutcomeRow:
    """The final state a crash should reach, and the one it reached."""

    key: str
    title: str
    expected_state: str
    expected_reason: str | None
    state: str | None
    reason: str | None

    @property
    def as_expected(self) -> bool:
        """Return whether state and reason are the expected ones."""
        return (self.state, self.reason) == (self.expected_state, self.expected_reason)


@dataclass(frozen=True)
class TruthScore:
    """A row for each vehicle of each crash that has a truth, the outcomes of all crashes, a summary."""

    rows: tuple[TruthRow, ...]
    outcomes: tuple[OutcomeRow, ...]
    summary: TruthSummary


def load_truth(path: Path) -> SampleTruth:
    """Return reads ``truth.json``.

    Raises:
        UserError: there is no such file, or it is not a truth file.
    """
    try:
        return SampleTruth.model_validate_json(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); name the sample's truth.json") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise UserError(
            f"{path}: not a truth file: {place or 'the file'}: {first['msg']}; data/sample/make_sample.py makes one"
        ) from error


def score_truth(
    truth: SampleTruth,
    estimates: Mapping[str, StateEstimate],
    *,
    outcomes: Mapping[str, tuple[str, str | None]] | None = None,
    hypothesis: Mapping[str, int] | None = None,
) -> TruthScore:
    """Return measures estimates, by key, against the truth.

    ``outcomes`` are final states and reasons by key, to be set beside the expected ones. ``hypothesis`` gives the index
    of the hypothesis to measure where it is not the first: the one a verdict chose.
    """
    chosen = hypothesis or {}
    rows: list[TruthRow] = []
    for crash in truth.crashes:
        estimate = estimates.get(crash.key)
        best = estimate.hypotheses[chosen.get(crash.key, 0)] if estimate is not None else None
        run = estimate.run if estimate is not None else None
        rows.extend(_row(crash, vehicle, best, run) for vehicle in crash.vehicles)
    compared = tuple(
        OutcomeRow(
            crash.key,
            crash.title,
            crash.expected.final_state,
            crash.expected.reason,
            *((outcomes or {}).get(crash.key) or (None, None)),
        )
        for crash in truth.crashes
    )
    return TruthScore(tuple(rows), compared, _summary(truth, rows, compared if outcomes is not None else None))


def _row(crash: TrueCrash, vehicle: TrueVehicle, hypothesis: Hypothesis | None, run: EstimatorRun | None) -> TruthRow:
    known: dict[str, Any] = {
        "key": crash.key,
        "title": crash.title,
        "vehicle_number": vehicle.vehicle_number,
        "manoeuvre": vehicle.manoeuvre,
        "street": vehicle.approach.street,
        "speed_reported": vehicle.speed_reported,
        "estimator": run.estimator if run is not None else None,
        "fallback_from": run.fallback_from if run is not None else None,
    }
    estimated = _participant(hypothesis, vehicle.vehicle_number)
    if hypothesis is None or estimated is None or crash.impact_point is None:
        return TruthRow(**known)
    errors: dict[str, Any] = {
        "impact_point_error_m": math.dist(
            hypothesis.impact_point_xy_m, (crash.impact_point.x_m, crash.impact_point.y_m)
        ),
        "heading_error_deg": _angle_deg(estimated.impact_pose.heading_rad, vehicle.impact_pose.heading_rad),
        "initial_heading_error_deg": _angle_deg(estimated.initial_pose.heading_rad, vehicle.initial_pose.heading_rad),
        "initial_speed_error_mps": estimated.initial_speed_mps - vehicle.initial_speed_mps,
        "impact_speed_error_mps": estimated.impact_speed_mps - vehicle.impact_speed_mps,
        "initial_position_error_m": math.dist(
            (estimated.initial_pose.x_m, estimated.initial_pose.y_m),
            (vehicle.initial_pose.x_m, vehicle.initial_pose.y_m),
        ),
        "estimated_manoeuvre": estimated.manoeuvre.value,
    }
    approach, lane = _came_from(vehicle, estimated.initial_pose)
    return TruthRow(**known, **errors, approach_correct=approach, lane_correct=lane)


def _participant(hypothesis: Hypothesis | None, number: int) -> ParticipantState | None:
    participants = hypothesis.participants if hypothesis is not None else ()
    return next((p for p in participants if p.vehicle_number == number), None)


def _angle_deg(a_rad: float, b_rad: float) -> float:
    return abs(math.degrees(wrap_angle(a_rad - b_rad)))


def _came_from(vehicle: TrueVehicle, pose: Pose) -> tuple[bool, bool]:
    """Return whether an initial pose lies on the true approach road, and in the true lane of it."""
    left_m, course_rad = _beside_path(np.array(vehicle.path), pose)
    # A backing vehicle points against the path it takes.
    towards = vehicle.initial_pose.heading_rad - _course_of_pose(vehicle)
    if abs(wrap_angle(pose.heading_rad - course_rad - _half_turns(towards))) > MAX_APPROACH_HEADING_RAD:
        return False, False
    room_left_m, room_right_m = vehicle.approach.room_m
    on_road = -room_right_m <= left_m <= room_left_m
    return on_road, on_road and abs(left_m) <= vehicle.approach.lane_width_m / 2


def _course_of_pose(vehicle: TrueVehicle) -> float:
    pose = vehicle.initial_pose
    return _beside_path(np.array(vehicle.path), Pose(pose.x_m, pose.y_m, pose.heading_rad))[1]


def _half_turns(angle_rad: float) -> float:
    return math.pi if abs(wrap_angle(angle_rad)) > math.pi / 2 else 0.0


def _beside_path(path_xy_m: FloatArray, pose: Pose) -> tuple[float, float]:
    """Return the distance of a pose to the left of a path, shape (n, 2), and the course of the path there.

    Beyond its ends the path goes on straight.
    """
    starts, steps = path_xy_m[:-1], np.diff(path_xy_m, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    along = steps / lengths[:, None]
    relative = pose.xy_m - starts
    progress = (relative * along).sum(axis=1)
    within = np.clip(progress, 0.0, lengths)
    if progress[0] < 0:
        within[0] = progress[0]
    if progress[-1] > lengths[-1]:
        within[-1] = progress[-1]
    distances = np.linalg.norm(relative - within[:, None] * along, axis=1)
    nearest = int(distances.argmin())
    ahead = along[nearest]
    left_m = float(ahead[0] * relative[nearest][1] - ahead[1] * relative[nearest][0])
    return left_m, math.atan2(float(ahead[1]), float(ahead[0]))


def _summary(truth: SampleTruth, rows: Iterable[TruthRow], outcomes: tuple[OutcomeRow, ...] | None) -> TruthSummary:
    by_crash: dict[str, list[TruthRow]] = {}
    for row in rows:
        by_crash.setdefault(row.key, []).append(row)
    measured = [pair for pair in by_crash.values() if all(row.approach_correct is not None for row in pair)]
    estimated = [pair for pair in measured if pair[0].fallback_from is None]
    vehicles = [row for pair in estimated for row in pair]
    both_reported = [row for pair in estimated if all(r.speed_reported for r in pair) for row in pair]
    one_unreported = [row for pair in estimated if not all(r.speed_reported for r in pair) for row in pair]
    return TruthSummary(
        crashes=len(by_crash),
        estimators=makers_in_words(Made(pair[0].estimator or "", pair[0].fallback_from) for pair in measured),
        estimated=len(estimated),
        fallbacks=len(measured) - len(estimated),
        approach_correct_share=_share(all(row.approach_correct for row in pair) for pair in estimated),
        lane_correct_share=_share(all(row.lane_correct for row in pair) for pair in estimated),
        median_impact_point_error_m=_median(pair[0].impact_point_error_m for pair in estimated),
        median_heading_error_deg=_median(row.heading_error_deg for row in vehicles),
        median_initial_position_error_m=_median(row.initial_position_error_m for row in both_reported),
        median_initial_position_error_unreported_m=_median(row.initial_position_error_m for row in one_unreported),
        median_speed_error_reported_mps=_median(
            abs(row.initial_speed_error_mps)
            for row in vehicles
            if row.speed_reported and row.initial_speed_error_mps is not None
        ),
        outcomes_as_expected=None if outcomes is None else sum(row.as_expected for row in outcomes),
        outcomes=None if outcomes is None else len(outcomes),
    )


def _share(values: Iterable[bool]) -> float | None:
    found = list(values)
    return sum(found) / len(found) if found else None


def _median(values: Iterable[float | None]) -> float | None:
    found = [value for value in values if value is not None]
    return median(found) if found else None
