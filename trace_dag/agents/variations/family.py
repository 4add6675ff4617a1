"""A crash's family: variations simulated, and which of them are kept."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from trace_dag.agents.variations.motion import perturb_motion
from trace_dag.agents.variations.perturbation import Bounds, Perturbation, draw
from trace_dag.scenario.cases import Case
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.plan import tracking_errors
from trace_dag.simulation.types import Backend, Participant, SimulationLog, Termination

_DRAWS_PER_VARIATION = 20
_LOOKED_AT_S = 0.25
_PAST_IMPACT_S = 1.0
_FAR_M = 30.0
_MAP_REACH_M = 250.0  # beyond it a map may simply end


class VariationKind(StrEnum):
    """Kinds of variations."""

    COLLISION = "collision"
    NEAR_MISS = "near_miss"


@dataclass(frozen=True)
class Criteria:
    """Criteria that a variation has to meet to be kept.

    * The bodies are apart at its beginning, and the simulation ends in good order.
    * A collision: the recorded pair touches first, within ``max_contact_shift_m`` of the recorded contact. A near miss:
      nobody touches anybody, and the pair comes within ``near_miss_m`` of each other.
    * It is drivable: up to then every vehicle keeps within ``max_path_error_m`` of its planned path.
    * It is on the road: no centre is farther outside the drivable lanes than ``max_outside_m``, or than the recorded
      motion was there.
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
