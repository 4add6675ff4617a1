"""Negative controls: what a verdict accepts that it should not.

Two clock positions either way let a random impact pass with 42 % per vehicle, so that a verdict has to show what its
acceptance is worth. Two ways of being wrong, both over a whole cohort, judged by the same rules as the true pairing:

* *another report*: a simulation against another crash's report. The location is left its own (another crash's is
  miles away and would prove nothing): impacts and directions must give it away. In a cohort with many head-on crashes
  many reports say the same; each row says whether the two reports differ at all.
* *shifted in time*: the same crash with one vehicle late, so that the two should miss or meet elsewhere. Where one of
  them
  stands at the place of the crash no delay makes them miss: not a control, and said so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.errors import Reason
from trace_dag.geometry import Pose
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import EstimatorRun, Hypothesis, ParticipantState, StateEstimate, Trajectory
from trace_dag.verdict.directions import reported_relations_deg, reported_turns_deg
from trace_dag.verdict.judge import judge_hypothesis, judge_observed, observe_crash
from trace_dag.verdict.metrics import clock_error_h
from trace_dag.verdict.types import Verdict

STANDING_MPS = 1.0
"""A vehicle slower than this at the planned contact stands there for what a delay can do."""
LEAST_SHIFT_S = 2.0
_MISS_BY_M = 10.0


@dataclass(frozen=True, eq=False)
class JudgedCrash:
    """A crash with the one hypothesis its verdict is about."""

    record: CrashRecord
    network: RoadNetwork
    hypothesis: Hypothesis
    log: SimulationLog


@dataclass(frozen=True)
class ControlRow:
    """One judgement of a control. ``kind``: "true", "other_report", "shifted", "mirrored" (a person that comes from the
    other side than reported, a vehicle that leaves the road to it), "dropped" or "swapped" (of several contacts),
    "parked_moved" or "object_moved"; ``crash_kind`` is the crash's; ``accepted`` is None where the control does not
    apply. Residuals as in the verdict: the worst of all parties, None where not evaluated. ``speeds_kept``, beyond the
    paper's criteria: every reported speed is driven; None where none is reported.
    """

    kind: str
    key: str
    other_key: str | None = None
    shifted_vehicle: int | None = None
    shift_s: float | None = None
    accepted: bool | None = None
    reason: Reason | None = None
    contact_distance_m: float | None = None
    clock_error_max_h: float | None = None
    direction_error_max_deg: float | None = None
    initial_speed_error_max_rel: float | None = None
    speeds_kept: bool | None = None
    detail: str = ""
    reports_differ: bool | None = None  # other_report: the two reports contradict each other
    crash_kind: str | None = None


def true_pairing(crash: JudgedCrash, settings: VerdictSettings) -> ControlRow:
    """The crash against its own report, for the rate beside the controls'."""
    verdict = judge_hypothesis(crash.record, crash.network, crash.hypothesis, crash.log, settings)
    return row_of("true", crash.record.key, verdict)


def against_other_reports(
    crash: JudgedCrash,
    others: Iterable[JudgedCrash],
    settings: VerdictSettings,
    in_place_of: Callable[[CrashRecord, CrashRecord], CrashRecord | None],
    differ: Callable[[CrashRecord, CrashRecord, VerdictSettings], bool],
) -> Iterator[ControlRow]:
    """One simulation against every other crash's report.

    ``in_place_of`` gives the other report the party numbers of the crash's own, None where they do not correspond;
    ``differ`` says whether two such reports contradict each other.

    >>> others = [judged_collision, judged_queue]
    >>> rows = against_other_reports(judged_collision, others, VerdictSettings(), renumbered, reports_differ)
    >>> [(row.other_key, row.accepted, row.reports_differ) for row in rows]
    [('2023-319101', False, True)]
    """
    observed = observe_crash(crash.record, crash.network, crash.hypothesis, crash.log, settings)
    for other in others:
        if other.record.key == crash.record.key:
            continue
        foreign = in_place_of(other.record, crash.record)
        if foreign is None:
            continue
        verdict = judge_observed(foreign, observed, settings)
        row = row_of("other_report", crash.record.key, verdict, other_key=other.record.key)
        yield replace(row, reports_differ=differ(crash.record, foreign, settings))


def of_same_kind(crash: JudgedCrash, others: Iterable[JudgedCrash]) -> Iterator[JudgedCrash]:
    """The crashes of the same kind.

    >>> [other.record.key for other in of_same_kind(judged_tree, [judged_collision, judged_tree, judged_pedestrian])]
    ['2023-319111']
    """
    return (other for other in others if other.record.kind is crash.record.kind)


def reports_differ(one: CrashRecord, two: CrashRecord, settings: VerdictSettings) -> bool:
    """Whether two reports, same vehicle numbers, contradict each other in an impact or a direction by more than the
    thresholds. Where they do not, no simulation of the one can be told from one of the other by them.

    >>> reports_differ(record, record, VerdictSettings()), reports_differ(record, queue_record, VerdictSettings())
    (False, True)
    """
    theirs = {vehicle.number: vehicle for vehicle in two.vehicles}
    pair = [(vehicle, theirs[vehicle.number]) for vehicle in one.vehicles if vehicle.number in theirs]
    for mine, other in pair:
        apart_h = clock_error_h(mine.impact.clock_h, other.impact) if mine.impact else None
        if apart_h is not None and apart_h > settings.max_clock_error_h:
            return True
        if _disjoint(reported_turns_deg(mine), reported_turns_deg(other)):
            return True
    if len(pair) < 2:
        return False
    (mine_1, other_1), (mine_2, other_2) = pair[:2]
    return _disjoint(reported_relations_deg(mine_1, mine_2), reported_relations_deg(other_1, other_2))


def _disjoint(one: frozenset[float], two: frozenset[float]) -> bool:
    return bool(one and two and not one & two)


def renumbered(other: CrashRecord, own: CrashRecord) -> CrashRecord | None:
    """The other record with its colliding pair numbered as the own one's, in the order of their numbers.

    >>> [vehicle.number for vehicle in renumbered(queue_record, record).vehicles], renumbered(tree_record, record)
    ([1, 2], None)
    """
    theirs, ours = other.colliding_vehicles, own.colliding_vehicles
    if theirs is None or ours is None:
        return None
    theirs_in_order = sorted(theirs, key=lambda vehicle: vehicle.number)
    numbers = sorted(vehicle.number for vehicle in ours)
    renamed = {vehicle.number: number for vehicle, number in zip(theirs_in_order, numbers, strict=True)}

    def rename(event: EventRecord) -> EventRecord:
        one = renamed.get(event.party_1) if event.party_1 is not None else None
        two = renamed.get(event.party_2) if event.party_2 is not None else None
        return replace(event, party_1=one, party_2=two)

    vehicles = tuple(replace(vehicle, number=renamed[vehicle.number]) for vehicle in theirs_in_order)
    return replace(other, vehicles=vehicles, events=tuple(rename(event) for event in other.events))


@dataclass(frozen=True, eq=False)
class Shift:
    """A hypothesis with one party late by ``shift_s``, or mirrored (0)."""

    hypothesis: Hypothesis
    vehicle_number: int
    shift_s: float


def shifted_in_time(hypothesis: Hypothesis) -> Shift | None:
    """The hypothesis with its first vehicle late enough that the two should miss or meet ten metres away or more.

    Delays by the time the slower one takes for that and for the two bodies, :data:`LEAST_SHIFT_S` at least. None if
    one of the two stands where they meet.

    >>> shift = shifted_in_time(hypothesis)  # 10 m and half of both lengths (4.85 and 2.20 m), by 6.26 m/s
    >>> shift.vehicle_number, round(shift.shift_s, 2)
    (1, 2.16)
    """
    one, two = _who_meet_first(hypothesis)
    slower_mps = min(abs(one.impact_speed_mps), abs(two.impact_speed_mps))
    if slower_mps < STANDING_MPS:
        return None
    shift_s = max(LEAST_SHIFT_S, (_MISS_BY_M + (one.length_m + two.length_m) / 2) / slower_mps)
    late = delayed(one, shift_s)
    states = tuple(late if state is one else state for state in hypothesis.participants)
    return Shift(replace(hypothesis, participants=states), one.vehicle_number, shift_s)


def _who_meet_first(hypothesis: Hypothesis) -> tuple[ParticipantState, ParticipantState]:
    """The two parties of the first contact: those of the first planned event, the only two where nothing is planned."""
    if not hypothesis.planned:
        one, two = hypothesis.participants[:2]
        return one, two
    first = hypothesis.planned[0]
    states = {state.vehicle_number: state for state in hypothesis.participants}
    return states[first.party_1], states[first.party_2]


def delayed(state: ParticipantState, delay_s: float) -> ParticipantState:
    """The same motion, later: the vehicle comes from further back, straight on and at its initial speed.

    >>> first = hypothesis.participants[0]
    >>> late = delayed(first, 2.0)  # at 6.26 m/s
    >>> round(math.dist(late.initial_pose.xy_m, first.initial_pose.xy_m), 2)  # metres farther back
    12.52
    """
    t = state.trajectory
    pose, speed = state.initial_pose, state.initial_speed_mps
    back_m = speed * delay_s
    x, y = pose.x_m - back_m * math.cos(pose.heading_rad), pose.y_m - back_m * math.sin(pose.heading_rad)
    return replace(
        state,
        initial_pose=Pose(x, y, pose.heading_rad, pose.z_m),
        trajectory=Trajectory(
            time_s=np.concatenate([[0.0], t.time_s + delay_s]),
            x_m=np.concatenate([[x], t.x_m]),
            y_m=np.concatenate([[y], t.y_m]),
            z_m=np.concatenate([[pose.z_m], t.z_m]),
            heading_rad=np.concatenate([[pose.heading_rad], t.heading_rad]),
            speed_mps=np.concatenate([[speed], t.speed_mps]),
        ),
    )


def shifted_estimate(crash: JudgedCrash, shift: Shift) -> StateEstimate:
    """What :func:`trace_dag.sim.run.simulate` takes to run a shifted hypothesis."""
    return StateEstimate(crash.record.key, (shift.hypothesis,), EstimatorRun("shifted in time", "1"))


def shifted_row(
    crash: JudgedCrash, shift: Shift | None, log: SimulationLog | None, settings: VerdictSettings
) -> ControlRow:
    """The judgement of a shifted run; ``shift`` and ``log`` are None where :func:`shifted_in_time` gave none."""
    if shift is None or log is None:
        detail = "one of the parties stands where they meet: no delay makes them miss"
        return ControlRow("shifted", crash.record.key, detail=detail)
    verdict = judge_hypothesis(crash.record, crash.network, shift.hypothesis, log, settings)
    return replace(
        row_of("shifted", crash.record.key, verdict), shifted_vehicle=shift.vehicle_number, shift_s=shift.shift_s
    )


def row_of(kind: str, key: str, verdict: Verdict, other_key: str | None = None) -> ControlRow:
    """A judgement as a row.

    >>> row = row_of("true", record.key, verdict)
    >>> row.accepted, row.clock_error_max_h, row.speeds_kept
    (True, 0.0, True)
    """
    return ControlRow(
        kind=kind,
        key=key,
        other_key=other_key,
        accepted=verdict.accepted,
        reason=verdict.reason,
        contact_distance_m=verdict.worst("contact_distance", "station_distance"),
        clock_error_max_h=verdict.worst("clock_error"),
        direction_error_max_deg=verdict.worst("direction_error", "relation_error", "course_error"),
        initial_speed_error_max_rel=verdict.worst("initial_speed_error"),
        speeds_kept=verdict.all_hold("initial_speed_error"),
        detail=verdict.detail,
    )
