"""Later contacts of another vehicle with a party of known motion: arriving, standing in its way, or slow.

Every possible path of the vehicle is moved forward among the parties already there, for every time after the earlier
contact, or with the vehicle standing anywhere along it. The first party that it touches has to be the right one, after
the earlier contact. Frame: the local frame; times from the beginning of the reconstruction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray, Poses, gaps_m
from trace_dag.common.messages.wording import count_of
from trace_dag.common.paths import Path
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.reconstruction.assemble import Drive, after_impact_s, drive_along
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.evidence import impact_area_log_likelihood
from trace_dag.reconstruction.motion.contact import STANDING_MPS, find_contact_points
from trace_dag.reconstruction.motion.manoeuvres import Option, keep_lane
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.planners.parked import STANDS, stands
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of, way_terms
from trace_dag.simulation.types import Body, VehicleLog

LONGEST_WAIT_S: Final = 8.0
"""A vehicle that comes later than this after the contact before belongs to another crash."""
_STEP_S: Final = 0.04  # between looks at who touches whom
_TIMING_STEP_S: Final = 0.2
_STANDING_STEP_M: Final = 0.5
_OFFSETS_M: Final = (0.0, 0.7, -0.7, 1.4, -1.4)  # left of the lane's centre
_OFFSET_SIGMA_M: Final = 0.7
_USUAL_HEADWAY_S, _HEADWAY_SIGMA = 1.0, 1.2  # a lognormal: few follow much closer, later ones can often stop
_PER_SECOND: Final = -0.15  # log-likelihood of the other party taking longer to come to one that stands
_QUEUE_GAP_M, _QUEUE_GAP_SIGMA_M = 2.0, 0.8  # queues stand 7 to 8 m a vehicle (HCM): a car's length and at least this
_QUEUE_SPREAD_M: Final = (
    8.0  # who stands farther behind another in a queue than a vehicle's length leaves a place in it
)
_LEAST_APART_M: Final = 0.2
_STANDS_UNSAID: Final = -0.7  # of standing, where nothing says how it moved
_LEAST_CLOSING_MPS: Final = 0.5


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """A body's simulated motion: arrays of equal length, headings unwrapped."""

    number: int
    length_m: float
    width_m: float
    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    heading_rad: FloatArray

    @classmethod
    def of(cls, log: VehicleLog, body: Body) -> SimulatedMotion:
        """Return the motion of a party of a simulation."""
        return cls(log.number, body.length_m, body.width_m, log.time_s, log.x_m, log.y_m, np.unwrap(log.heading_rad))

    @property
    def size_m(self) -> tuple[float, float]:
        """Return the length and width."""
        return self.length_m, self.width_m

    def at(self, time_s: FloatArray) -> Poses:
        """Return x, y and heading at some times; the place of rest after the last one."""
        x, y, heading = (np.interp(time_s, self.time_s, each) for each in (self.x_m, self.y_m, self.heading_rad))
        return x, y, heading


@dataclass(frozen=True, eq=False)
class Arrival:
    """One way for the vehicle to come to the contact at ``time_s``, touched in a direction of its body."""

    drive: Drive
    bearing_rad: float
    time_s: float
    score: float

    @property
    def group(self) -> tuple[str, bool]:
        """Return the group; arrivals of one group differ only in detail."""
        return self.drive.option.approach.name, self.drive.profile.impact_mps <= STANDING_MPS

    @property
    def name(self) -> str:
        """Return a name that is unique among the arrivals of the vehicle."""
        return f"vehicle {self.drive.party.vehicle.number}: {self.drive.option.name} at {self.time_s:.1f} s"


@dataclass(frozen=True, eq=False)
class _Way:
    option: Option
    path: Path
    speed: TravelSpeed
    profile: SpeedProfile
    score: float


def arrivals(
    scene: Scene, contact: CrashEvent, newcomer: int, there: Sequence[SimulatedMotion], *, after_s: float
) -> list[Arrival]:
    """Return every way for a vehicle to have this contact as its first after a time, likeliest first.

    ``there`` has the motions of all parties already present, including the other party of the contact.
    """
    who = party(scene.record, contact.as_struck(newcomer))
    (target,) = (motion for motion in there if motion.number in contact.pair)
    others = [motion for motion in there if motion is not target]
    found = []
    for way in _ways(scene, who):
        arrival = _best(way, who, contact, target, others, after_s)
        if arrival is not None:
            found.append(arrival)
    return sorted(found, key=lambda each: (-round(each.score, 6), each.name))


def arrival_plans(search: Search, course: Course, contact: CrashEvent, newcomer: int) -> Iterator[Plan | str]:
    """Yield the plans in which a vehicle comes to a contact with a party already there."""
    motions = [SimulatedMotion.of(each, course.log.bodies[each.number]) for each in course.log.vehicles]
    (known,) = (number for number in contact.pair if number != newcomer)
    found = arrivals(search.scene, contact, newcomer, motions, after_s=_after_s(search, course))
    for arrival in found:
        after_s = after_impact_s(arrival.drive.profile, LONGEST_WAIT_S)
        state = drive_along(
            search.scene.network,
            arrival.drive,
            lead_time_s=arrival.time_s,
            after_s=after_s,
            bearing_rad=arrival.bearing_rad,
        )
        terms = {f"arrival of vehicle {newcomer}": round(arrival.score, 6)}
        yield Plan((*course.states, state), course.objects, arrival.name, arrival.score, terms, arrival.group)
    if not found:
        ways = count_of(len(search.scene.approaches), "way")
        yield f"on none of {ways} past the crash vehicle {newcomer} comes to touch vehicle {known} after that"


def _after_s(search: Search, course: Course) -> float:
    """Return the time of the earlier event, or of the first one if the order is not known."""
    times = [each.time_s for each in course.matching.matched if each is not None]
    if not times:
        return float(course.states[0].trajectory.time_s[0])
    return max(times) if search.sequence.order_known else min(times)


# --- ways ------------------------------------------------------------------------------------------------------------
def _ways(scene: Scene, who: Party) -> Iterator[_Way]:
    if not who.vehicle.in_transport:
        for stand in stands(scene, who.vehicle):
            score = math.fsum(stand.terms.values())
            yield _Way(stand.option, stand.option.path(), STANDS, SpeedProfile(0.0, 0.0), score)
        return
    for option, speed, terms in approaches_of(scene, who, approaches=_approaches(scene, who)):
        yield from _beside(option, speed, speed_profile(who, speed.speed_mps), math.fsum(terms.values()))
    if _may_stand(who):
        for approach in scene.through:
            option = keep_lane(approach, who.vehicle, 0.0)
            terms = way_terms(scene, who, option, STANDS)
            yield from _beside(option, STANDS, SpeedProfile(0.0, 0.0), math.fsum(terms.values()) + _STANDS_UNSAID)


def _approaches(scene: Scene, who: Party) -> list[Approach] | None:
    """Return all through approaches of the road for a vehicle that does not turn, or None.

    An earlier vehicle may have gone across to any of them.
    """
    return scene.through if who.turn is None else None


def _may_stand(who: Party) -> bool:
    """Return whether the vehicle may have stood although that is not reported: its motion is not reported either."""
    return who.vehicle.travel_speed_mps is None and not who.stationary and who.turn is None and not who.backing


def _beside(option: Option, speed: TravelSpeed, profile: SpeedProfile, score: float) -> Iterator[_Way]:
    shiftable = option.turn is None and option.shift is None
    for offset_m in _OFFSETS_M if shiftable else (0.0,):
        moved = replace(option, constant_m=option.constant_m + offset_m) if offset_m else option
        yield _Way(moved, moved.path(), speed, profile, score - 0.5 * (offset_m / _OFFSET_SIGMA_M) ** 2)


# --- contacts --------------------------------------------------------------------------------------------------------
def _best(
    way: _Way,
    who: Party,
    contact: CrashEvent,
    target: SimulatedMotion,
    others: Sequence[SimulatedMotion],
    after_s: float,
) -> Arrival | None:
    """Return the likeliest timing or standing place of one path; None if it never has the contact first."""
    size = (who.vehicle.length_m, who.vehicle.width_m)
    meets = after_s + np.arange(_TIMING_STEP_S, LONGEST_WAIT_S, _TIMING_STEP_S)
    stations, when = _placings(way, target, size, meets)
    if len(stations) == 0:
        return None
    time = np.arange(0.0, float(meets[-1]) + 2.0, _STEP_S)
    at = stations[:, None] + _travelled(way.profile, time[None, :] - when[:, None])
    newcomer = way.path.plan(at)
    if way.option.backing:
        newcomer = (newcomer[0], newcomer[1], newcomer[2] + math.pi)
    standing = way.profile.impact_mps <= STANDING_MPS
    gaps = [_gaps_m(newcomer, size, each, time) for each in (target, *others)]
    first, *in_the_way = (np.where((gap <= 0).any(axis=1), (gap <= 0).argmax(axis=1), len(time)) for gap in gaps)
    before = np.min([gap[:, time <= after_s].min(axis=1) for gap in gaps], axis=0)
    first = np.where(before < _LEAST_APART_M, len(time), first)
    for other in in_the_way:
        first = np.where(other <= first, len(time), first)
    kept = np.flatnonzero((first < len(time)) & (first > 0) & (time[np.minimum(first, len(time) - 1)] > after_s))
    if len(kept) == 0:
        return None
    index = first[kept]
    bodies = tuple(each[kept, index] for each in newcomer)
    touch_s = time[index]
    touch = find_contact_points((bodies[0], bodies[1], bodies[2]), size, target.at(touch_s), target.size_m)
    score = impact_area_log_likelihood(contact.as_struck(who.vehicle.number), touch.bearing_1_rad)
    score = score + impact_area_log_likelihood(contact.as_struck(target.number), touch.bearing_2_rad)
    if standing:
        missing_m = np.maximum(_QUEUE_GAP_M - before[kept], 0.0)
        score = score + _PER_SECOND * (touch_s - after_s) - 0.5 * (missing_m / _QUEUE_GAP_SIGMA_M) ** 2
        if _stood(target, after_s):
            score = score - _left_free_m(way, target, size, stations[kept]) / _QUEUE_SPREAD_M
    else:
        score = score + _headway(touch_s - after_s)
    score = _steadied(score, kept)
    score = np.where(touch.found & (_closing(way, target, bodies, touch_s) > _LEAST_CLOSING_MPS), score, -np.inf)
    best = int(np.argmax(np.round(score, 6)))
    if score[best] == -np.inf:
        return None
    station = float(at[kept[best], index[best]])
    drive = Drive(who, way.option, way.path, station, way.speed, way.profile)
    return Arrival(drive, float(touch.bearing_1_rad[best]), float(touch_s[best]), way.score + float(score[best]))


def _stood(target: SimulatedMotion, until_s: float) -> bool:
    """Return whether the other party stood from the beginning until just before a time."""
    (x0, x1), (y0, y1), _ = target.at(np.array([0.0, until_s - _STEP_S]))
    return math.hypot(x1 - x0, y1 - y0) < _LEAST_APART_M


def _left_free_m(way: _Way, target: SimulatedMotion, size_m: tuple[float, float], stations: FloatArray) -> FloatArray:
    """Return, for each station of a standing vehicle, the gap to another that stood beyond the usual gap in a queue."""
    x, y, _ = target.at(np.zeros(1))
    station_m, _ = way.path.project(float(x[0]), float(y[0]))
    gaps = np.abs(stations - station_m) - (size_m[0] + target.length_m) / 2
    return np.asarray(np.maximum(gaps - _QUEUE_GAP_M, 0.0))


def _placings(
    way: _Way, target: SimulatedMotion, size_m: tuple[float, float], meets_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return stations, and the times at which the vehicle is there.

    At that time it is beside the other party, or stands near its path.
    """
    reach = (math.hypot(*size_m) + math.hypot(*target.size_m)) / 2
    x, y, _ = target.at(meets_s)
    near = way.path.project_all(x, y)
    near_s, aside = near[:, 0], np.abs(near[:, 1])
    use = aside <= reach
    if not use.any():
        return np.zeros(0), np.zeros(0)
    if way.profile.impact_mps > STANDING_MPS:
        return near_s[use], meets_s[use]
    lengths = (size_m[0] + target.length_m) / 2
    stations = np.arange(near_s[use].min() - lengths, near_s[use].max() + lengths + _STANDING_STEP_M, _STANDING_STEP_M)
    return stations, np.full_like(stations, float(meets_s[0]))


def _travelled(profile: SpeedProfile, since_s: FloatArray) -> FloatArray:
    """Return the distance from the vehicle's position at time 0, negative before it."""
    before = np.minimum(since_s, 0.0)
    change = profile.change_time_s
    distance = profile.impact_mps * since_s
    if change > 0:
        lost = profile.initial_mps - profile.impact_mps
        within = np.minimum(-before, change)
        distance = distance - lost * (0.5 * within**2 / change + np.maximum(-before - change, 0.0))
    return np.asarray(distance)


def _gaps_m(newcomer: Poses, size_m: tuple[float, float], other: SimulatedMotion, time_s: FloatArray) -> FloatArray:
    """Return gaps between each row of the newcomer's motion and another body.

    They are infinite for distant bodies.
    """
    x, y, heading = other.at(time_s)
    reach = (math.hypot(*size_m) + math.hypot(*other.size_m)) / 2 + _QUEUE_GAP_M
    dx, dy = newcomer[0] - x, newcomer[1] - y
    rows, columns = np.nonzero(dx * dx + dy * dy <= reach * reach)
    found = np.full(newcomer[0].shape, np.inf)
    if len(rows):
        bodies = (newcomer[0][rows, columns], newcomer[1][rows, columns], newcomer[2][rows, columns])
        found[rows, columns] = gaps_m(bodies, size_m, (x[columns], y[columns], heading[columns]), other.size_m)
    return found


def _headway(since_s: FloatArray) -> FloatArray:
    """Return the log-likelihood of coming so long after the contact before."""
    headways = np.maximum(since_s, _STEP_S) / _USUAL_HEADWAY_S
    return np.asarray(-0.5 * (np.log(headways) / _HEADWAY_SIGMA) ** 2)


def _steadied(score: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    """Return each score, averaged with its neighbours', so that a score that a small error would lose counts less."""
    lone = score + math.log(0.5)
    before = np.where(np.diff(places, prepend=-2) == 1, np.roll(score, 1), lone)
    after = np.where(np.diff(places, append=places[-1] + 2) == 1, np.roll(score, -1), lone)
    return np.asarray(0.5 * score + 0.25 * (before + after))


def _closing(way: _Way, target: SimulatedMotion, bodies: tuple[FloatArray, ...], time_s: FloatArray) -> FloatArray:
    """Return the closing speed of the two centres."""
    sense = -1.0 if way.option.backing else 1.0
    own = sense * way.profile.impact_mps
    before, now = target.at(time_s - _STEP_S), target.at(time_s)
    vx, vy = (now[0] - before[0]) / _STEP_S, (now[1] - before[1]) / _STEP_S
    return np.asarray(np.hypot(own * np.cos(bodies[2]) - vx, own * np.sin(bodies[2]) - vy))
