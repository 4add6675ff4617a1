"""A crash's family: perturbations of speed, timing, place, reaction and friction, simulated, and those that are kept.

A vehicle only follows its recorded path, moved sideways. Speeds are scaled about the recorded impact, so that a change
of speed alone still brings it to the same place at the same time; timing is its own perturbation. If a vehicle would
begin before its recorded path, the beginning is cut off for all vehicles alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from hashlib import sha256

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.scenario.cases import Case
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.plan import tracking_errors
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import Backend, Participant, SimulationLog, Termination

_DRAWS_PER_VARIATION = 20
_LOOKED_AT_S = 0.25
_PAST_IMPACT_S = 1.0
_FAR_M = 30.0
_MAP_REACH_M = 250.0  # beyond it a map may simply end
BRAKING_MPS2 = 5.0
"""With which a driver who reacts brakes, if friction allows it: usual emergency braking of untrained drivers."""

_STEP_S = 0.02
_STANDS_M = 0.05


class VariationKind(StrEnum):
    """Kinds of variations."""

    COLLISION = "collision"
    NEAR_MISS = "near_miss"


@dataclass(frozen=True)
class Criteria:
    """Criteria that a variation has to meet to be kept.

    * Begin and end: the bodies do not overlap at the beginning, and the simulation ends without a failure.
    * A collision: the pair of the recorded crash touches first, within ``max_contact_shift_m`` of the recorded contact.
    * A near miss, instead: no bodies touch, and that pair comes within ``near_miss_m`` of each other.
    * Drivable: until the contact, or the least distance, each vehicle stays within ``max_path_error_m`` of its path.
    * On the road: no vehicle's centre is farther outside the drivable lanes than ``max_outside_m``, or than it was at
      most in the recorded crash.
    """

    max_contact_shift_m: float = 15.0
    near_miss_m: float = 1.0
    max_path_error_m: float = 1.0
    max_outside_m: float = 0.5


@dataclass(frozen=True, eq=False)
class Variation:
    """A variation that was kept: what was changed, and the scenario it is, participants, friction and log."""

    variation_id: str
    number: int
    perturbation: Perturbation
    kind: VariationKind
    gap_m: float  # least distance between the two bodies; 0 for a collision
    case: Case


def variation_id(key: str, number: int) -> str:
    """Return the id of a crash's variation: ``2023-510179-v001``.

    >>> variation_id('2023-510179', 1)
    '2023-510179-v001'
    """
    return f"{key}-v{number:03d}"


def family(
    case: Case, backend: Backend, *, count: int, seed: int, bounds: Bounds, criteria: Criteria
) -> tuple[list[Variation], int]:
    """Return the first ``count`` variations that meet the criteria, and the number drawn (at most twenty each).

    The result depends on the case, the seed and the bounds alone.
    """
    kept: list[Variation] = []
    drawn = 0
    for drawn, variation in enumerate(_drawn(case, backend, seed, bounds, criteria), start=1):
        if variation is not None:
            number = len(kept) + 1
            name = variation_id(case.key, number)
            kept.append(
                replace(variation, variation_id=name, number=number, case=replace(variation.case, case_id=name))
            )
        if len(kept) == count or drawn == count * _DRAWS_PER_VARIATION:
            break
    return kept, drawn


def _drawn(case: Case, backend: Backend, seed: int, bounds: Bounds, criteria: Criteria) -> Iterator[Variation | None]:
    numbers = [each.number for each in case.participants]
    allowed_m = {
        each.number: max(criteria.max_outside_m, _farthest_outside_m(case, each, criteria.max_outside_m))
        for each in case.participants
    }
    index = 0
    while True:
        perturbation = draw(case.key, numbers, seed, index, bounds)
        yield _tried(case, perturbation, backend, criteria, allowed_m)
        index += 1


def _tried(
    case: Case, perturbation: Perturbation, backend: Backend, criteria: Criteria, allowed_m: Mapping[int, float]
) -> Variation | None:
    participants, impact_s = perturb_motion(case.participants, perturbation, case.impact_time_s)
    friction = case.friction * perturbation.friction_factor
    varied = replace(case, participants=participants, friction=friction, impact_time_s=impact_s)
    if any(_farthest_outside_m(varied, each, allowed_m[each.number]) > allowed_m[each.number] for each in participants):
        return None
    going_on = varied.going_on
    log = backend.load(case.network, case.xodr, friction=friction).run(going_on, time_limit_s=varied.end_s)
    found = _judged(case, going_on, log, criteria)
    return None if found is None else Variation("", 0, perturbation, *found, replace(varied, recorded=log))


def _judged(
    case: Case, participants: tuple[Participant, ...], log: SimulationLog, criteria: Criteria
) -> tuple[VariationKind, float] | None:
    """Return the kind of a simulated variation and the least gap between the pair, or None if it fails the criteria."""
    if log.termination in (Termination.STARTED_IN_CONTACT, Termination.DIVERGED, Termination.BACKEND_ERROR):
        return None
    recorded, contact = case.contact, log.first_contact
    pair = set(case.pair)
    if contact is not None and recorded is not None:
        shift_m = math.hypot(contact.x_m - recorded.x_m, contact.y_m - recorded.y_m)
        if {contact.number_1, contact.number_2} != pair or shift_m > criteria.max_contact_shift_m:
            return None
        kind, gap_m, until_s = VariationKind.COLLISION, 0.0, contact.time_s
    else:
        gap_m, until_s = _nearest(log, pair)
        if gap_m > criteria.near_miss_m:
            return None
        kind = VariationKind.NEAR_MISS
    for participant, vehicle in zip(participants, log.parties, strict=True):
        errors, _ = tracking_errors(participant.trajectory, vehicle, until_s)
        if len(errors) and float(errors.max()) > criteria.max_path_error_m:
            return None
    return kind, gap_m


def _nearest(log: SimulationLog, pair: set[int]) -> tuple[float, float]:
    """Return the least gap between two bodies over a log, m, and its time."""
    one, two = (vehicle for vehicle in log.vehicles if vehicle.number in pair)
    size_1, size_2 = (
        (log.bodies[each.number].length_m / 2, log.bodies[each.number].width_m / 2) for each in (one, two)
    )
    least_m, when_s = math.inf, 0.0
    for k, time_s in enumerate(one.time_s.tolist()):
        box_1 = Outline(float(one.x_m[k]), float(one.y_m[k]), float(one.heading_rad[k]), *size_1)
        box_2 = Outline(float(two.x_m[k]), float(two.y_m[k]), float(two.heading_rad[k]), *size_2)
        gap_m = separation(box_1, box_2)[0]
        if gap_m < least_m:
            least_m, when_s = gap_m, time_s
    return max(least_m, 0.0), when_s


def _farthest_outside_m(case: Case, participant: Participant, least_m: float) -> float:
    """Return the largest distance of a plan outside the lanes before it is past the impact, m.

    Infinity if no lane is near.
    """
    t = participant.trajectory
    step_s = float(np.median(np.diff(t.time_s))) if len(t.time_s) > 1 else _LOOKED_AT_S
    farthest_m = 0.0
    for k in range(0, len(t.time_s), max(1, round(_LOOKED_AT_S / step_s))):
        x, y = float(t.x_m[k]), float(t.y_m[k])
        if t.time_s[k] > case.impact_time_s + _PAST_IMPACT_S or math.hypot(x, y) > _MAP_REACH_M:
            continue
        near = case.network.nearest_lanes(x, y, least_m) or case.network.nearest_lanes(x, y, _FAR_M)
        farthest_m = max(farthest_m, near[0].outside_m if near else math.inf)
    return farthest_m


@dataclass(frozen=True)
class Bounds:
    """Bounds of variations; each change is drawn evenly from within.

    ``speed_rel``: largest relative change of all speeds of a vehicle. ``timing_s``: earlier or later. ``lateral_m``: to
    the left or right. ``friction_low``: least friction as a share of the crash's, which is the most. ``reaction_s``:
    longest time before the recorded impact at which a driver, in half of the variations, begins to brake.
    """

    speed_rel: float = 0.15
    timing_s: float = 0.4
    lateral_m: float = 0.4
    friction_low: float = 0.6
    reaction_s: float = 1.2


@dataclass(frozen=True)
class VehiclePerturbation:
    """Changes to one vehicle. ``reaction_s``: time before the recorded impact from which it brakes; 0 for never."""

    number: int
    speed_factor: float
    delay_s: float
    offset_left_m: float
    reaction_s: float


@dataclass(frozen=True)
class Perturbation:
    """Changes of one variation. ``friction_factor`` multiplies the friction of the crash."""

    vehicles: tuple[VehiclePerturbation, ...]
    friction_factor: float


def draw(key: str, numbers: Sequence[int], seed: int, index: int, bounds: Bounds) -> Perturbation:
    """Return the ``index``-th draw for a crash.

    The result depends on these values alone, not on the order of calls.
    """
    digest = sha256(f"{seed}:{key}:{index}".encode()).digest()
    random = np.random.default_rng(int.from_bytes(digest[:16], "big"))
    friction = float(random.uniform(bounds.friction_low, 1.0))
    vehicles = []
    for number in numbers:
        speed, delay, offset, reacts, reaction = random.uniform(size=5).tolist()
        vehicles.append(
            VehiclePerturbation(
                number=number,
                speed_factor=1 + bounds.speed_rel * (2 * speed - 1),
                delay_s=bounds.timing_s * (2 * delay - 1),
                offset_left_m=bounds.lateral_m * (2 * offset - 1),
                reaction_s=bounds.reaction_s * reaction if reacts < 0.5 else 0.0,
            )
        )
    return Perturbation(tuple(vehicles), friction)


# --- motion ----------------------------------------------------------------------------------------------------------
def perturb_motion(
    participants: Sequence[Participant], perturbation: Perturbation, impact_time_s: float
) -> tuple[tuple[Participant, ...], float]:
    """Return the perturbed participants, and the time of the recorded impact on their clock.

    The clock begins when all participants are on their recorded paths.
    """
    by_number = {each.number: each for each in perturbation.vehicles}
    start_s = max((_earliest_s(each, by_number[each.number], impact_time_s) for each in participants), default=0.0)
    return (
        tuple(_moved(each, by_number[each.number], impact_time_s, start_s) for each in participants),
        impact_time_s - start_s,
    )


def _recorded_time_s(time_s: FloatArray | float, change: VehiclePerturbation, impact_time_s: float) -> FloatArray:
    """Return the time at which the recorded motion was at the perturbed one's place, without braking."""
    return np.asarray(impact_time_s + change.speed_factor * (np.asarray(time_s) - change.delay_s - impact_time_s))


def _earliest_s(participant: Participant, change: VehiclePerturbation, impact_time_s: float) -> float:
    """Return the time at which the perturbed motion is at the recorded one's beginning."""
    if _stands(participant.trajectory):
        return 0.0
    return max(0.0, impact_time_s - impact_time_s / change.speed_factor + change.delay_s)


def _stands(trajectory: Trajectory) -> bool:
    return float(np.hypot(np.diff(trajectory.x_m), np.diff(trajectory.y_m)).sum()) < _STANDS_M


def _moved(participant: Participant, change: VehiclePerturbation, impact_time_s: float, start_s: float) -> Participant:
    t = participant.trajectory
    last_s = float(t.time_s[-1])
    if _stands(t):
        time_s = recorded_s = t.time_s
        rate = np.ones(len(time_s))
    else:
        end_s = impact_time_s + change.delay_s + (last_s - impact_time_s) / change.speed_factor
        time_s = np.asarray(np.arange(math.floor((end_s - start_s) / _STEP_S) + 1) * _STEP_S, np.float64)
        recorded_s = np.asarray(np.clip(_recorded_time_s(time_s + start_s, change, impact_time_s), 0.0, last_s))
        rate = np.full(len(time_s), change.speed_factor)
        if change.reaction_s > 0:
            recorded_s, rate = _braking(t, time_s, recorded_s, rate, impact_time_s - start_s - change.reaction_s)
    heading = np.interp(recorded_s, t.time_s, np.unwrap(t.heading_rad))
    yaw_rate = (
        np.interp(recorded_s, t.time_s, np.gradient(np.unwrap(t.heading_rad), t.time_s)) if len(t.time_s) > 1 else 0
    )
    speed = np.interp(recorded_s, t.time_s, t.speed_mps)
    left = change.offset_left_m
    trajectory = Trajectory(
        time_s=time_s,
        x_m=np.interp(recorded_s, t.time_s, t.x_m) - left * np.sin(heading),
        y_m=np.interp(recorded_s, t.time_s, t.y_m) + left * np.cos(heading),
        z_m=np.interp(recorded_s, t.time_s, t.z_m),
        heading_rad=heading,
        speed_mps=rate * (speed - left * yaw_rate),
    )
    start = Pose(
        float(trajectory.x_m[0]),
        float(trajectory.y_m[0]),
        math.remainder(float(heading[0]), math.tau),
        float(trajectory.z_m[0]),
    )
    return replace(
        participant, initial_pose=start, initial_speed_mps=float(trajectory.speed_mps[0]), trajectory=trajectory
    )


def _braking(
    trajectory: Trajectory, time_s: FloatArray, recorded_s: FloatArray, rate: FloatArray, from_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the motion with brakes from a time on: recorded times reached, and their rate.

    A braking vehicle moves through the recorded motion ever slower, at a rate that follows from its speed there.
    """
    recorded_s, rate = recorded_s.copy(), rate.copy()
    lost_mps = 0.0
    for k in range(1, len(time_s)):
        if time_s[k] <= from_s:
            continue
        lost_mps += BRAKING_MPS2 * _STEP_S
        wanted_mps = abs(rate[0] * float(np.interp(recorded_s[k - 1], trajectory.time_s, trajectory.speed_mps)))
        share = max(0.0, 1 - lost_mps / wanted_mps) if wanted_mps > 0 else 0.0
        rate[k] = rate[0] * share
        recorded_s[k] = min(recorded_s[k - 1] + rate[k] * _STEP_S, float(trajectory.time_s[-1]))
    return recorded_s, rate
