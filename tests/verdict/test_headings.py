"""Reported directions of travel as a criterion, and crashes of registers that have no areas of impact."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.verdict.crashes import CROSSROADS, STREET, simulated
from tests.verdict.test_judge import ANGLE, ANGLE_RECORD, HEAD_ON, HEAD_ON_RECORD, REPORT
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings, VerdictSettings
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.completeness import check
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import CrashRecord, Heading, Moment, Octant, PreCrashMovement
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.observation import observe_crash
from trace_dag.verdict.reservations import place_doubts, simulation_doubts
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Doubt, Support, Verdict


def headed(record: CrashRecord, *octants: Octant, moment: Moment = Moment.BEFORE) -> CrashRecord:
    both = zip(record.vehicles, octants, strict=True)
    return replace(
        record, vehicles=tuple(replace(vehicle, heading=Heading(octant, moment)) for vehicle, octant in both)
    )


def judged(trajectories, record: CrashRecord, network=STREET, settings: VerdictSettings | None = None) -> Verdict:
    return judge_hypothesis(record, network, *simulated(*trajectories), settings or VerdictSettings())


def errors(verdict: Verdict) -> list[float]:
    return [round(each.value) for each in verdict.criteria if each.name == "headed_as_reported"]


def test_vehicles_that_go_as_reported_pass():
    verdict = judged(HEAD_ON, headed(HEAD_ON_RECORD, Octant.EAST, Octant.WEST))
    assert verdict.accepted
    assert errors(verdict) == [0, 0]


def test_a_crash_the_other_way_round_is_rejected_by_45_degrees():
    verdict = judged(HEAD_ON, headed(HEAD_ON_RECORD, Octant.WEST, Octant.EAST))
    assert (verdict.accepted, verdict.reason) == (False, Reason.WRONG_DIRECTION)
    assert errors(verdict) == [180, 180]
    askew = judged(HEAD_ON, headed(HEAD_ON_RECORD, Octant.NORTH_EAST, Octant.WEST))
    assert errors(askew) == [45, 0]
    assert askew.accepted


def test_without_reported_directions_nothing_is_asked():
    assert errors(judged(HEAD_ON, HEAD_ON_RECORD)) == []


def test_one_that_turned_may_be_headed_as_after_its_turn_where_the_moment_is_not_known():
    turned = replace(ANGLE_RECORD.vehicles[0], movement=PreCrashMovement.GOING_STRAIGHT)
    record = replace(ANGLE_RECORD, vehicles=(turned, ANGLE_RECORD.vehicles[1]))
    north_and_east = judged(ANGLE, headed(record, Octant.NORTH, Octant.EAST, moment=Moment.UNKNOWN), CROSSROADS)
    assert errors(north_and_east) == [0, 0]


@pytest.fixture
def without_areas() -> CrashRecord:
    vehicles = (
        replace(vehicle, impact=None, initial_impact_code=None, crash_type_code=None)
        for vehicle in HEAD_ON_RECORD.vehicles
    )
    return replace(
        HEAD_ON_RECORD, vehicles=tuple(vehicles), register="town", register_lacks=("impact", "crash_type_code"),
        events=tuple(replace(event, area_1=None, area_2=None) for event in HEAD_ON_RECORD.events),
    )  # fmt: skip


def test_a_register_without_areas_is_judged_without_them_and_never_corroborated(without_areas):
    verdict = judged(HEAD_ON, headed(without_areas, Octant.EAST, Octant.WEST))
    assert verdict.accepted
    found = place_doubts(without_areas, STREET, REPORT, Support((), 1.0, 1))
    assert Doubt.NO_AREAS in {each.doubt for each in found}


def test_a_report_of_fars_without_areas_is_still_incomplete(without_areas):
    silent = replace(without_areas, register="fars", register_lacks=(), manner_of_collision_code=6)
    silent = replace(silent, junction_relation_code=1)
    with pytest.raises(Rejection, match="incomplete_impact"):
        check(silent, CrashSettings())
    check(complete_record(replace(silent, register="town", register_lacks=("impact",))), CrashSettings())


def test_a_harmless_impact_is_no_doubt_where_nobody_was_killed():
    hypothesis, log = simulated(*HEAD_ON)
    gentle = replace(
        log, contacts=tuple(replace(c, delta_v_1_mps=(0.1, 0.0), delta_v_2_mps=(0.1, 0.0)) for c in log.contacts)
    )
    seen = observe_crash(STREET, hypothesis, gentle)
    hurt = replace(HEAD_ON_RECORD, register="town", injury_code=2)

    def doubts(record: CrashRecord) -> list[Doubt]:
        beside = Comparison.of(record, sequence_of(record), seen, VerdictSettings())
        return [each.doubt for each in simulation_doubts(beside, ())]

    assert doubts(hurt) == []
    killed = replace(hurt, injury_code=4)
    assert doubts(killed) == [Doubt.HARMLESS]
