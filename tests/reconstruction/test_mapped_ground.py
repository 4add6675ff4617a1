"""Who is where none can be before the first event."""

from __future__ import annotations

from dataclasses import replace

import example_objects
import numpy as np
import pytest

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import EventRecord
from trace_dag.reconstruction.scene.mapped_ground import Astray, Way, astray, on_mapped_ground
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.states import StateEstimate
from trace_dag.verdict.judge import judge

RECORD = example_objects.record_of("record")  # a car turns left across a motorcycle on Main Street
MADE = example_objects.made_of("record")
STREET_M = 5000.0  # far beyond the map
PLANNED = MADE.state_estimate.best.participants[1].trajectory  # vehicle 2 along Main Street
TIME_S = np.linspace(0.0, 4.9, 50)


def way(beside_m: np.ndarray, *, number: int = 2, kind: PartyKind = PartyKind.MOTOR_VEHICLE) -> Way:
    """Along Main Street, and so far beside it at each time."""
    x_m, y_m = (np.interp(TIME_S, PLANNED.time_s, values) for values in (PLANNED.x_m, PLANNED.y_m))
    return Way(number, kind, TIME_S, x_m, y_m + beside_m)


def found(*ways: Way, record=RECORD, things=()) -> tuple[Astray, ...]:
    return astray(record, MADE.network, things, ways, 4.9)


BEGINS_OFF = np.where(TIME_S < 1.95, STREET_M, 0.0)
ENDS_OFF = np.where(TIME_S > 3.95, STREET_M, 0.0)


def test_a_vehicle_beginning_off_the_map_is_astray_until_it_reaches_a_road() -> None:
    assert found(way(0.0 * TIME_S)) == ()
    (stray,) = found(way(BEGINS_OFF))
    assert stray.until_s == pytest.approx(2.0)
    assert stray.off_m > 100.0


def test_a_departing_vehicle_is_astray_unless_reported() -> None:
    (stray,) = found(way(ENDS_OFF))
    assert stray.until_s is None
    assert "vehicle 2 is up to" in str(stray)
    collided = replace(RECORD.events[0], number=2)
    ran_off = replace(RECORD, events=(EventRecord(1, 63, 2, None, None, None), collided))
    on_roadside = replace(RECORD, road_relation_code=4)
    for record in (ran_off, on_roadside):
        assert found(way(ENDS_OFF), record=record) == ()
        assert found(way(BEGINS_OFF), record=record) != (), "it came along the road"


def test_people_walk_anywhere_but_through_buildings() -> None:
    walks = way(STREET_M + 0.0 * TIME_S, kind=PartyKind.PEDESTRIAN)
    assert found(walks) == ()
    x_m, y_m = float(walks.x_m[25]), float(walks.y_m[25])
    corners = [(x_m + dx, y_m + dy) for dx, dy in ((-5, -9), (5, -9), (5, 9), (-5, 9), (-5, -9))]
    house = MappedThing("w1", "building", tuple(corners))
    (stray,) = found(walks, things=(house,))
    assert stray.in_building
    assert stray.until_s is None


def test_a_verdict_rejects_who_drives_beside_the_road() -> None:
    (log,) = MADE.logs[:1]
    one, two = log.vehicles
    beside = replace(log, vehicles=(one, replace(two, y_m=two.y_m + STREET_M)))
    logs = (beside,) * len(MADE.logs)
    verdict = judge(RECORD, MADE.network, MADE.map_report, MADE.state_estimate, logs, example_objects.SETTINGS.verdict)
    (ground,) = [each for each in verdict.criteria if each.name == "mapped_ground"]
    assert (ground.passed, ground.reason, ground.vehicle_number) == (False, Reason.WRONG_LOCATION, 2)


def shifted(estimate: StateEstimate, until_s: float) -> StateEstimate:
    """The estimate with the best hypothesis' first vehicle beside the street until a time."""
    best = estimate.best
    one, *others = best.participants
    path = one.trajectory
    aside = replace(path, y_m=np.where(path.time_s < until_s, path.y_m + STREET_M, path.y_m))
    moved = replace(best, participants=(replace(one, trajectory=aside), *others))
    return replace(estimate, hypotheses=(moved,))


def test_the_time_before_the_crash_is_shortened_where_the_map_ends() -> None:
    asked: list[float] = []

    def made_with(lead_s: float, _most: int) -> StateEstimate:
        asked.append(lead_s)
        return shifted(MADE.state_estimate, 2.0 if lead_s == 5.0 else 0.0)

    made = on_mapped_ground(RECORD, MADE.network, MADE.map_report, made_with, 5.0, 3)
    assert len(made.hypotheses) == 1
    assert asked[0] == 5.0
    assert 2.5 <= asked[1] <= 3.0


def test_less_likely_ways_are_asked_for_where_all_kept_ones_lead_beside_the_street() -> None:
    best = MADE.state_estimate.best
    one, *others = best.participants
    path = one.trajectory
    leaves = replace(path, y_m=np.where(path.time_s > 2.0, path.y_m + STREET_M, path.y_m))
    astray = replace(best, participants=(replace(one, trajectory=leaves), *others))
    beside = replace(MADE.state_estimate, hypotheses=(astray,))

    def made_with(_lead_s: float, most: int) -> StateEstimate:
        less_likely = replace(best, score=best.score - 1.0)
        return beside if most == 3 else replace(beside, hypotheses=(astray, less_likely))

    made = on_mapped_ground(RECORD, MADE.network, MADE.map_report, made_with, 5.0, 3)
    assert [each.score for each in made.hypotheses] == [best.score - 1.0]
    with pytest.raises(Rejection) as caught:
        on_mapped_ground(RECORD, MADE.network, MADE.map_report, lambda *_: beside, 5.0, 3)
    assert caught.value.reason is Reason.NO_FEASIBLE_STATE


def test_a_map_that_ends_at_the_crash_is_too_small() -> None:
    with pytest.raises(Rejection) as caught:
        on_mapped_ground(RECORD, MADE.network, MADE.map_report, lambda *_: shifted(MADE.state_estimate, 4.5), 5.0, 3)
    assert caught.value.reason is Reason.MAP_TOO_SMALL
    assert caught.value.measured > 100.0
