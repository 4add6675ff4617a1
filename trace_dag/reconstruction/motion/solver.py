"""States from a candidate: the contact of the two bodies, and their initial positions.

The solver moves both bodies along their paths (:mod:`trace_dag.reconstruction.motion.contact`) for a range of timings,
takes the first contact that agrees best with the reported areas and the reported place, and moves those paths to that
place that can be anywhere along the road. Then each vehicle's speed profile runs backward from the impact. Speeds are
inputs, never results.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import Path
from trace_dag.crash.crash_types import Relation
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.candidates import Candidate
from trace_dag.reconstruction.evidence import impact_area_log_likelihood, manner_log_likelihood, place_log_likelihood
from trace_dag.reconstruction.motion.contact import Contacts, Mover, first_contacts
from trace_dag.reconstruction.motion.manoeuvres import Option

TIMINGS = 41
SLIDES = 3
SLID_ENOUGH_M = 0.2
MAX_SLIDE_M = 30.0
TURN_SLIDE_SIGMA_M = 8.0  # how far a turn may begin from where the lanes have it
_TIMING_COST = 0.05  # per second
_LONE_TIMING = -0.7  # a contact whose neighbouring timings miss would be lost by a small error


@dataclass(frozen=True, eq=False)
class Placed:
    """One vehicle at the impact: its path, its station, and its further motion."""

    option: Option
    path: Path
    station_m: float
    pose: Pose
    bearing_rad: float


@dataclass(frozen=True, eq=False)
class Solution:
    """A candidate with its contact. ``terms`` are all log-likelihood terms, prior ones included."""

    candidate: Candidate
    mover: Placed
    other: Placed
    contact_xy_m: tuple[float, float]
    place_xy_m: tuple[float, float]  # where the contact should be
    terms: dict[str, float] = field(default_factory=dict)
    place_accuracy_m: float = 0.0  # how far the reported place usually is from the crash, where that is known

    @property
    def score(self) -> float:
        """Return the log-likelihood, rounded so that the order of solutions does not depend on the last bits."""
        return round(self.candidate.scenario.log_prior + math.fsum(self.terms.values()), 6)

    @property
    def name(self) -> str:
        """Return the names of both vehicles' manoeuvres and approaches, unique among the candidates of one crash."""
        scenario = self.candidate.scenario
        return "; ".join(
            f"vehicle {party.vehicle.number}: {placed.option.name}"
            for party, placed in sorted(
                ((scenario.mover, self.mover), (scenario.other, self.other)), key=lambda pair: pair[0].vehicle.number
            )
        )


def solve(candidate: Candidate, record: CrashRecord, x_m: float, y_m: float) -> Solution | None:
    """Return the best first contact of a candidate near a place, or None."""
    scenario = candidate.scenario
    slide = [0.0, 0.0]
    best: tuple[Contacts, int, Mover, Mover] | None = None
    ahead_s = 0.0
    slides = (candidate.mover.slides, candidate.parallel and candidate.other.slides)
    for _ in range(SLIDES if any(slides) else 1):
        movers = _movers(candidate, slide, x_m, y_m)
        if movers is None:
            return None
        contacts = first_contacts(*movers, timings=TIMINGS, span_s=_span_s(candidate))
        if len(contacts) == 0:
            return None
        areas = impact_area_log_likelihood(scenario.mover.vehicle, contacts.bearing_1_rad)
        areas = areas + impact_area_log_likelihood(scenario.other.vehicle, contacts.bearing_2_rad)
        areas = areas + manner_log_likelihood(record, contacts.bearing_1_rad, contacts.bearing_2_rad)
        score = areas + place_log_likelihood(record, _unslidable(candidate, slides, contacts, x_m, y_m))
        # Along one road many timings differ in nothing but the place: keep one of them while sliding.
        timing = contacts.time_1_s - contacts.time_2_s
        index = int(np.argmax(np.round(_steadied(score) - _TIMING_COST * np.abs(timing - ahead_s), 6)))
        ahead_s = float(timing[index])
        best = (contacts, index, *movers)
        if not any(slides):
            break
        missing = np.array([x_m - contacts.x_m[index], y_m - contacts.y_m[index]])
        moves = [
            float(missing @ option.nominal_pose(slide[i]).forward) if slides[i] else 0.0
            for i, option in enumerate((candidate.mover, candidate.other))
        ]
        if max(abs(move) for move in moves) < SLID_ENOUGH_M:
            break
        slide = [min(max(slide[i] + moves[i], -MAX_SLIDE_M), MAX_SLIDE_M) for i in range(2)]
    assert best is not None
    return _solution(candidate, record, *best, slide, x_m, y_m)


def _span_s(candidate: Candidate) -> float:
    """Return the time in which two vehicles side by side come together while one changes lanes (seconds)."""
    shift = candidate.mover.shift
    if shift is None or candidate.scenario.relation is not Relation.SAME_DIRECTION:
        return 0.0
    return shift.length_m / max(candidate.mover_profile.impact_mps, 1.0)


def _movers(candidate: Candidate, slide: list[float], x_m: float, y_m: float) -> tuple[Mover, Mover] | None:
    scenario = candidate.scenario
    options = (candidate.mover, candidate.other)
    paths = [option.path(slide[i]) for i, option in enumerate(options)]
    stations = []
    if candidate.parallel and candidate.mover.turn is None:
        for option, path, moved in zip(options, paths, slide, strict=True):
            pose = option.nominal_pose(moved)
            stations.append(path.project(pose.x_m, pose.y_m)[0])
        if scenario.relation is Relation.SAME_LANE:
            # One behind the other: the follower's station is where it touches, not where the bodies would overlap.
            ahead = scenario.other.vehicle
            stations[0] -= (scenario.mover.vehicle.length_m + ahead.length_m) / 2
            if ahead.trailer is not None:
                stations[0] -= ahead.trailer.combination_length_m - ahead.length_m
    else:
        conflict = _conflict(paths[0], paths[1], x_m, y_m)
        if conflict is None:
            return None
        stations = list(conflict)
    profiles = (candidate.mover_profile, candidate.other_profile)
    first, second = (
        Mover.of(vehicle, path, station, profile.impact_mps, backing=option.backing)
        for path, station, profile, vehicle, option in zip(
            paths, stations, profiles, (scenario.mover.vehicle, scenario.other.vehicle), options, strict=True
        )
    )
    return first, second


def _conflict(one: Path, two: Path, x_m: float, y_m: float) -> tuple[float, float] | None:
    """Return stations at which two paths are closest to each other near a place.

    None if they stay more than 6 m apart.
    """
    spans = []
    for path in (one, two):
        near = np.flatnonzero(np.hypot(path.x_m - x_m, path.y_m - y_m) < 40.0)
        if len(near) == 0:
            return None
        spans.append(near[::2])
    a, b = spans
    apart = np.hypot(one.x_m[a][:, None] - two.x_m[b][None, :], one.y_m[a][:, None] - two.y_m[b][None, :])
    to_place = np.hypot(one.x_m[a] - x_m, one.y_m[a] - y_m)[:, None]
    cost = np.maximum(apart, 1.0) + 0.05 * to_place
    i, j = np.unravel_index(int(np.argmin(np.round(cost, 6))), cost.shape)
    if apart[i, j] > 6.0:
        return None
    return float(one.s_m[a[i]]), float(two.s_m[b[j]])


def _unslidable(
    candidate: Candidate, slides: tuple[bool, bool], contacts: Contacts, x_m: float, y_m: float
) -> FloatArray:
    """Return the part of each contact's distance from the place that sliding along the road cannot remove."""
    dx, dy = contacts.x_m - x_m, contacts.y_m - y_m
    if not any(slides):
        return np.asarray(np.hypot(dx, dy))
    option = candidate.mover if slides[0] else candidate.other
    forward = option.nominal_pose(0.0).forward
    return np.asarray(np.abs(dy * forward[0] - dx * forward[1]))


def _steadied(score: FloatArray) -> FloatArray:
    """Return each contact's score, averaged with those of the neighbouring timings."""
    if len(score) == 1:
        return score
    padded = np.concatenate([[score[0] + _LONE_TIMING], score, [score[-1] + _LONE_TIMING]])
    return np.asarray(0.5 * score + 0.25 * (padded[:-2] + padded[2:]))


def _solution(
    candidate: Candidate,
    record: CrashRecord,
    contacts: Contacts,
    index: int,
    one: Mover,
    two: Mover,
    slide: list[float],
    x_m: float,
    y_m: float,
) -> Solution:
    scenario = candidate.scenario
    vehicles = (scenario.mover.vehicle, scenario.other.vehicle)
    bearings = (contacts.bearing_1_rad[index : index + 1], contacts.bearing_2_rad[index : index + 1])
    terms = dict(candidate.terms)
    for vehicle, bearing in zip(vehicles, bearings, strict=True):
        value = float(impact_area_log_likelihood(vehicle, bearing)[0])
        if vehicle.impact is not None:
            terms[f"impact area (vehicle {vehicle.number})"] = value
    manner = float(manner_log_likelihood(record, *bearings)[0])
    if manner:
        terms["manner of collision"] = manner
    distance = math.hypot(contacts.x_m[index] - x_m, contacts.y_m[index] - y_m)
    terms["place of the impact"] = float(place_log_likelihood(record, np.array(distance)))
    for vehicle, option, moved in zip(vehicles, (candidate.mover, candidate.other), slide, strict=True):
        if option.turn is not None and moved:
            terms[f"place of the turn (vehicle {vehicle.number})"] = -0.5 * (moved / TURN_SLIDE_SIGMA_M) ** 2
    placed = [
        _placed(option, mover, float(time[index]), float(bearing[0]))
        for option, mover, time, bearing in zip(
            (candidate.mover, candidate.other),
            (one, two),
            (contacts.time_1_s, contacts.time_2_s),
            bearings,
            strict=True,
        )
    ]
    contact_xy_m = (float(contacts.x_m[index]), float(contacts.y_m[index]))
    accuracy_m = record.position_accuracy_m or 0.0
    return Solution(candidate, placed[0], placed[1], contact_xy_m, (x_m, y_m), terms, accuracy_m)


def _placed(option: Option, mover: Mover, time_s: float, bearing_rad: float) -> Placed:
    station = mover.station_m + mover.speed_mps * time_s
    pose = mover.path.pose(station)
    if option.backing:
        pose = Pose(pose.x_m, pose.y_m, math.remainder(pose.heading_rad + math.pi, math.tau), pose.z_m)
    return Placed(option, mover.path, station, pose, bearing_rad)
