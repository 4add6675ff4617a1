"""From when on each of two could see the other: expected by similar triangles, from the eye and corners of a car.

A car's eye (CAR: 4.7 m long, 1.85 m wide, 1.45 m high) is 0.21 m behind its middle, 0.33 m left of it, 1.11 m up; of a
car 1.2 m has to be seen.
"""

from __future__ import annotations

import math

import pytest
import shapely

from tests.simulation.motions import CAR, TRUCK, crossing, log_of, meeting, participant, straight
from tests.verdict.crashes import FRAME
from trace_dag.crash.record import VehicleClass
from trace_dag.osm.types import OsmFeature
from trace_dag.scenario.sight_lines import sight_lines
from trace_dag.simulation.types import Body, BodyKind, Participant
from trace_dag.verdict.types import SightLine

CHILD = Body(BodyKind.PEDESTRIAN, VehicleClass.OTHER, 0.25, 0.35, 1.1, 20.0)
VAN = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.VAN, 5.5, 1.8, 2.0, 2000.0)


def feature(shape: shapely.Geometry, **tags: str) -> OsmFeature:
    return OsmFeature("way/1", shapely.transform(shape, lambda at_m: FRAME.to_geographic(at_m)[:, ::-1]), tags)


CROSSING = log_of(meeting(math.pi / 2, 10.0, 10.0))
CORNER = shapely.box(-60.0, -60.0, -8.0, -8.0)  # between the one from the west and the one from the south
WALL = shapely.LineString([(-60.0, -8.0), (-8.0, -8.0), (-8.0, -60.0)])


def of_both(*features: OsmFeature) -> tuple[SightLine, ...]:
    lines = sight_lines(CROSSING, features, FRAME)
    assert [(each.driver, each.other) for each in lines] == [(1, 2), (2, 1)]
    return lines


@pytest.mark.parametrize(
    ("thing", "name"),
    [
        (feature(CORNER, building="yes"), "building"),
        (feature(WALL, barrier="wall"), "wall"),
        (feature(WALL, barrier="wall", height="1.3 m"), "wall"),
    ],
)
def test_a_corner_hides_each_until_both_are_close(thing, name):
    """With their middles d from where their ways cross, the eye of 1 is at (-d - 0.21, 0.33), the near corner of 2 at
    (-0.925, -d + 2.35). The line passes (-8, -8) where 8.33 / (d - 2.02) = (d - 7.79) / (d - 0.715), at d = 16.85 m:
    1.685 s before the middles would meet, and they touch 0.328 s before that (d = 2.35 + 0.925)."""
    seen = of_both(thing)[0]
    assert seen.seen_for_s == pytest.approx(1.36, abs=0.11)
    assert (seen.hidden_by, seen.osm_id) == (name, "way/1")
    assert seen.hidden_s == ((0.0, pytest.approx(2.0 - 1.685, abs=0.11)),)


@pytest.mark.parametrize(
    "thing",
    [
        feature(WALL, barrier="wall", height="1.0 m"),  # below every eye
        feature(CORNER, building="roof"),
        feature(CORNER, building="yes", **{"building:min_level": "1"}),
        feature(WALL, barrier="fence"),
        feature(shapely.box(20.0, 20.0, 60.0, 60.0), building="yes"),  # beyond
        feature(shapely.box(-15.0, -5.0, -5.0, 5.0), building="yes"),  # driven through: not at this level
    ],
)
def test_nothing_else_hides(thing):
    for each in of_both(thing):
        assert (each.hidden_s, each.hidden_share, each.hidden_by) == ((), 0.0, "")
        assert each.seen_for_s == pytest.approx(2.0 - 0.328, abs=0.11), "all that was simulated"


def parked_before(one: Participant, other: Participant) -> SightLine:
    """The view of one, eastbound, of another from the south; a van is at x = -8.75 to -3.25 m, y = -4.4 to -2.6 m."""
    van = participant(3, straight(-6.0, -3.5, 0.0, 0.0), VAN)
    line, _ = sight_lines(log_of((one, other, van)), [], FRAME)
    return line


def test_a_parked_van_hides_a_child():
    """Three seconds before, the car's eye is 30 m and more away and the child 4.2 m beside its path: the line is at
    y = -2.9 m at the van's rear. A second later the child is at -2.8 m, and the line at -2.3 m at the van's front."""
    seen = parked_before(*crossing(CAR, CHILD, 10.0, lead_s=4.0))
    assert (seen.driver, seen.other, seen.hidden_by, seen.osm_id) == (1, 1001, "vehicle 3", "")
    assert 2.0 <= seen.seen_for_s < 3.0


def test_a_parked_van_does_not_hide_a_truck():
    """Its top, 2.95 m of it, is 30 m away; 8 m nearer the line is 2.4 m up, and the van 2 m."""
    truck = participant(2, straight(0.0, -10.0, math.pi / 2, 1.4), TRUCK)
    assert parked_before(participant(1, straight(-40.0, 0.0, 0.0, 10.0)), truck).hidden_s == ()
