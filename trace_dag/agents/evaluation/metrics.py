"""Measures of one evaluation, from its log beside the recorded crash, and the outcome that sums them up.

The risk of serious injury in a contact is that of the curves of the warehouse's view ``injury_risk``. The curves are
for occupants of cars and people on foot, and here cover all directions. For motorcyclists, whose risk is higher, and
for trucks they only rank contacts of the same bodies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from trace_dag.agents.evaluation.rules import measure_rules
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.parties import party_of_body
from trace_dag.scenario.cases import Case
from trace_dag.scenario.conflicts import post_encroachment_time_s, time_to_contact_s
from trace_dag.scenario.progress import RecordedWay
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.types import Body, Contact, SimulationLog, VehicleLog, overturned_at

_TTC_STEP_S = 0.1
_SHORTEST_S = 1e-3
_SMOOTHED_S = 0.2  # accelerations are means over so long
OFF_ROAD_S = 0.5
"""A vehicle that is off the road for longer has left it."""
_SAME_REL = 0.1
_TEFFT_10_MPH, _TEFFT_90_MPH = 17.1, 48.1


class DriveOutcome(StrEnum):
    """Outcomes for the crash, as in studies of agents in reconstructed crashes (Scanlon et al., Waymo, 2021).

    A conflict is entered when two are at most :data:`ENTERED_TTC_S` from touching if they keep their velocities.
    """

    CONFLICT_AVOIDED = "conflict_avoided"  # never entered
    COLLISION_AVOIDED = "collision_avoided"  # entered, and nobody touched anybody
    DID_NOT_ARRIVE = "did_not_arrive"  # nobody touched anybody, and the agent never got past the conflict
    RULES_BROKEN = "rules_broken"  # it got past, but off the road, or faster than traffic drives
    MITIGATED = "mitigated"  # a risk of serious injury lower by more than a tenth of the recorded one
    UNCHANGED = "unchanged"
    WORSE = "worse"  # higher by as much
    FAULTY = "faulty"  # the agent broke its side of the interface


AVOIDED = frozenset({DriveOutcome.CONFLICT_AVOIDED, DriveOutcome.COLLISION_AVOIDED})
"""Nobody touched anybody, and the agent got past the conflict, on the road and no faster than traffic drives."""
ENTERED_TTC_S = 1.5
"""The time to collision of a serious conflict: Van der Horst and Hogema, Time-to-collision and collision avoidance
systems, ICTCT 1993."""


@dataclass(frozen=True)
class Metrics:
    """Measures of one run; None where there is nothing to measure (no contact, no shared place).

    ``delta_v_mps`` is the larger one of the first contact's two bodies, ``own_delta_v_mps`` the agent's own.
    ``contact_shift_s`` and ``contact_shift_m`` say how far its first contact is from the recorded one. ``min_ttc_s``
    takes bodies to keep their velocity; it and the post-encroachment time are 0 for those that touch.
    ``required_deceleration_mps2`` is the most that was needed not to touch (:func:`needed_mps2`), None with a contact
    or off a collision course. The comfort
    measures are of the time before any contact. ``serious_injury_risk`` is the larger one of the first contact's two
    (:mod:`trace_dag.agents.evaluation.metrics`). ``finished``: nobody touched anybody, and the agent came 50 m
    beyond the conflict, or to the end of its recorded way, within twice the recorded time; ``arrived``: past the
    conflict. ``over_traffic_mps``: the most above 1.25 times the limit, or the highest speed of the recorded vehicle
    where that is more. ``recorded_off_road_s``: of the recorded vehicle before the conflict, 0 of one that left the
    road.
    """

    collided: bool
    contact_time_s: float | None
    contact_shift_s: float | None
    contact_shift_m: float | None
    closing_speed_mps: float | None
    delta_v_mps: float
    own_delta_v_mps: float
    recorded_delta_v_mps: float
    recorded_own_delta_v_mps: float
    min_ttc_s: float | None
    post_encroachment_time_s: float | None
    off_road_s: float
    wrong_way_s: float
    over_limit_mps: float
    stop_signs_passed: int
    max_deceleration_mps2: float
    max_lateral_mps2: float
    max_jerk_mps3: float
    overturned: bool = False
    recorded_overturned: bool = False
    serious_injury_risk: float = 0.0
    recorded_serious_injury_risk: float = 0.0
    finished: bool = False
    arrived: bool = False
    over_traffic_mps: float = 0.0
    recorded_off_road_s: float = 0.0
    required_deceleration_mps2: float | None = None


def outcome_of(metrics: Metrics, *, departed: bool = False) -> DriveOutcome:
    """Return the outcome of a run; ``departed``: the agent replaces a vehicle that left the road by itself."""
    if departed:
        return _of_departure(metrics)
    if not metrics.collided:
        if not metrics.arrived:
            return DriveOutcome.DID_NOT_ARRIVE
        if metrics.off_road_s > metrics.recorded_off_road_s + OFF_ROAD_S or metrics.over_traffic_mps > 0.0:
            return DriveOutcome.RULES_BROKEN
        entered = metrics.min_ttc_s is not None and metrics.min_ttc_s <= ENTERED_TTC_S
        return DriveOutcome.COLLISION_AVOIDED if entered else DriveOutcome.CONFLICT_AVOIDED
    more = metrics.serious_injury_risk - metrics.recorded_serious_injury_risk
    if abs(more) <= _SAME_REL * metrics.recorded_serious_injury_risk:
        return DriveOutcome.UNCHANGED
    return DriveOutcome.WORSE if more > 0 else DriveOutcome.MITIGATED


def _of_departure(metrics: Metrics) -> DriveOutcome:
    """Return the outcome of an agent in place of a vehicle that left the road.

    Overturning weighs more than the risk of a contact. Leaving the road without either counts as mitigated.
    """
    if not metrics.overturned and not metrics.collided:
        if metrics.off_road_s > OFF_ROAD_S:
            return DriveOutcome.MITIGATED
        return outcome_of(replace(metrics, min_ttc_s=None))
    if metrics.overturned != metrics.recorded_overturned:
        return DriveOutcome.WORSE if metrics.overturned else DriveOutcome.MITIGATED
    return outcome_of(replace(metrics, collided=True))


def measure(case: Case, ego: int, log: SimulationLog) -> Metrics:
    """Return measures of a run of a case with an agent at the wheel of participant ``ego``."""
    contact, recorded = log.first_contact, case.contact
    until_s = log.duration_s if contact is None else contact.time_s
    own = log.vehicle_log(ego)
    others = [vehicle for vehicle in log.vehicles if party_of_body(vehicle.number) != ego]
    shift_s = shift_m = None
    if contact and recorded:
        shift_s = contact.time_s - recorded.time_s
        shift_m = math.hypot(contact.x_m - recorded.x_m, contact.y_m - recorded.y_m)
    least_ttc_s, least_pet_s, needed = (0.0, 0.0, None) if contact else _nearest_miss(own, others, log.bodies)
    return Metrics(
        collided=contact is not None,
        overturned=overturned_at(own) is not None,
        recorded_overturned=any(overturned_at(v) is not None for v in case.recorded.vehicles if v.number == ego),
        contact_time_s=contact.time_s if contact else None,
        contact_shift_s=shift_s,
        contact_shift_m=shift_m,
        closing_speed_mps=contact.closing_speed_mps if contact else None,
        delta_v_mps=_largest_delta_v_mps(contact),
        own_delta_v_mps=_own_delta_v_mps(contact, ego),
        recorded_delta_v_mps=_largest_delta_v_mps(recorded),
        recorded_own_delta_v_mps=_own_delta_v_mps(recorded, ego),
        min_ttc_s=least_ttc_s,
        post_encroachment_time_s=least_pet_s,
        required_deceleration_mps2=needed,
        serious_injury_risk=risk_of_contact(contact, log.bodies),
        recorded_serious_injury_risk=risk_of_contact(recorded, case.recorded.bodies),
        finished=contact is None and RecordedWay(case, ego).is_finished(own),
        **driven_measures(case, ego, own, until_s),
        **_comfort(own, until_s),
    )


def driven_measures(case: Case, ego: int, own: VehicleLog, until_s: float) -> dict[str, Any]:
    """Return the measures of path and speed up to a time, by the names of :class:`Metrics`."""
    highest_mps, recorded_off_road_s = _as_recorded(case, ego)
    return {
        **asdict(measure_rules(case.network, own, until_s, highest_mps)),
        "arrived": RecordedWay(case, ego).is_past_conflict(own),
        "recorded_off_road_s": recorded_off_road_s,
    }


def _as_recorded(case: Case, ego: int) -> tuple[float, float]:
    """Return the recorded vehicle's highest speed before the conflict, and its time off the road until then.

    If its crash was leaving the road, the time is 0.
    """
    recorded = case.recorded.vehicle_log(ego)
    before = recorded.time_s < case.impact_time_s
    highest_mps = float(np.abs(recorded.speed_mps[before]).max(initial=0.0))
    if case.departed is not None:
        return highest_mps, 0.0
    return highest_mps, measure_rules(case.network, recorded, case.impact_time_s, highest_mps).off_road_s


def _delta_v_mps(contact: Contact) -> tuple[float, float]:
    return math.hypot(*contact.delta_v_1_mps), math.hypot(*contact.delta_v_2_mps)


def _largest_delta_v_mps(contact: Contact | None) -> float:
    return max(_delta_v_mps(contact)) if contact else 0.0


def _own_delta_v_mps(contact: Contact | None, ego: int) -> float:
    if contact is None or ego not in (contact.number_1, contact.number_2):
        return 0.0
    return _delta_v_mps(contact)[0 if ego == contact.number_1 else 1]


def _nearest_miss(
    own: VehicleLog, others: list[VehicleLog], bodies: dict[int, Body]
) -> tuple[float | None, float | None, float | None]:
    """Return the least time to contact, least post-encroachment time and highest needed deceleration.

    Each is None if it is never defined: without a collision course, or without a place that both pass.
    """
    body = bodies[own.number]
    courses = [each for other in others for each in _collision_courses(own, body, other, bodies[other.number])]
    gaps = [post_encroachment_time_s(own, body, other, bodies[other.number]) for other in others]
    return (
        min((time_s for time_s, _ in courses), default=None),
        min((gap_s for gap_s in gaps if gap_s is not None), default=None),
        max((needed for _, needed in courses), default=None),
    )


def _collision_courses(one: VehicleLog, body_1: Body, two: VehicleLog, body_2: Body) -> Iterator[tuple[float, float]]:
    """Yield times to contact (s) and needed decelerations of the first body (m/s2) while on a collision course."""
    step_s = float(one.time_s[1] - one.time_s[0]) if len(one.time_s) > 1 else _TTC_STEP_S
    for k in range(0, len(one.time_s), max(1, round(_TTC_STEP_S / step_s))):
        (outline_1, velocity_1), (outline_2, velocity_2) = _at(one, body_1, k), _at(two, body_2, k)
        left_s = time_to_contact_s(outline_1, velocity_1, outline_2, velocity_2)
        if not math.isinf(left_s):
            yield left_s, needed_mps2(left_s, outline_1.ahead, velocity_1, velocity_2)


def needed_mps2(
    left_s: float, ahead: tuple[float, float], own_mps: tuple[float, float], other_mps: tuple[float, float]
) -> float:
    """Return the constant deceleration needed to avoid a contact in ``left_s``, both on straight paths.

    It reduces the closing speed along the own heading, a unit vector, to zero within the gap that closes in that time:
    the deceleration rate to avoid a crash (Cooper and Ferguson, Traffic Engineering and Control 17, 1976).

    >>> needed_mps2(2.0, (1.0, 0.0), (20.0, 0.0), (10.0, 0.0))  # 20 m behind one at 10 m/s: 10 ** 2 / (2 * 20)
    2.5
    """
    closing_mps = (own_mps[0] - other_mps[0]) * ahead[0] + (own_mps[1] - other_mps[1]) * ahead[1]
    return max(closing_mps, 0.0) / (2 * max(left_s, _SHORTEST_S))


def _at(log: VehicleLog, body: Body, k: int) -> tuple[Outline, tuple[float, float]]:
    outline = Outline(
        float(log.x_m[k]), float(log.y_m[k]), float(log.heading_rad[k]), body.length_m / 2, body.width_m / 2
    )
    return outline, (float(log.velocity_x_mps[k]), float(log.velocity_y_mps[k]))


def _comfort(log: VehicleLog, until_s: float) -> dict[str, Any]:
    """Return the hardest braking and cornering (m/s2) and the highest jerk (m/s3) along the body.

    They are means over a fifth of a second.
    """
    count = int(np.searchsorted(log.time_s, until_s, side="right"))
    step_s = float(log.time_s[1] - log.time_s[0]) if len(log.time_s) > 1 else _SMOOTHED_S
    window = max(1, round(_SMOOTHED_S / step_s))
    if count < 2 * window:
        return {"max_deceleration_mps2": 0.0, "max_lateral_mps2": 0.0, "max_jerk_mps3": 0.0}
    kernel = np.full(window, 1 / window)
    along = np.convolve(log.acceleration_mps2[:count] * np.sign(log.speed_mps[:count] + 1e-9), kernel, mode="valid")
    across = np.convolve(log.yaw_rate_rps[:count] * log.speed_mps[:count], kernel, mode="valid")
    jerk = (along[window:] - along[:-window]) / (window * step_s)
    return {
        "max_deceleration_mps2": float(max(0.0, -along.min())),
        "max_lateral_mps2": float(np.abs(across).max()),
        "max_jerk_mps3": float(np.abs(jerk).max(initial=0.0)),
    }


# --- injury risk -----------------------------------------------------------------------------------------------------
def occupants_risk(delta_v_mps: float) -> float:
    """Return the risk of serious injury (MAIS 3 and more) of a car's occupants.

    Malliaris, Digges, DeBlois, SAE 970393, 1997.

    >>> round(occupants_risk(10.0), 3), round(occupants_risk(20.0), 3)
    (0.187, 0.925)
    """
    return _logistic(-5.450 + 0.178 * mps_to_mph(delta_v_mps))


def struck_persons_risk(closing_mps: float) -> float:
    """Return the risk of severe injury (AIS 4 and more) of a person struck.

    Tefft, Accident Analysis and Prevention 50, 2013.

    >>> round(struck_persons_risk(17.1 * 0.44704), 2), round(struck_persons_risk(48.1 * 0.44704), 2)
    (0.1, 0.9)
    """
    middle, slope = (_TEFFT_10_MPH + _TEFFT_90_MPH) / 2, 2 * math.log(9) / (_TEFFT_90_MPH - _TEFFT_10_MPH)
    return _logistic(slope * (mps_to_mph(closing_mps) - middle))


def risk_of_contact(contact: Contact | None, bodies: dict[int, Body]) -> float:
    """Return the larger risk of the two bodies in contact; 0 without a contact."""
    if contact is None:
        return 0.0
    risks = []
    for number, delta_v_mps in ((contact.number_1, contact.delta_v_1_mps), (contact.number_2, contact.delta_v_2_mps)):
        if number in bodies and bodies[number].is_figure:
            risks.append(struck_persons_risk(contact.closing_speed_mps))
        elif number in bodies:
            risks.append(occupants_risk(math.hypot(*delta_v_mps)))
    return max(risks)


def _logistic(log_odds: float) -> float:
    return 1 / (1 + math.exp(-log_odds))
