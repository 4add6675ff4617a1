"""First contacts, judged by shapely: touching, never overlapping, never preceded by another."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from trace_dag.common.geometry import Pose, contact_clock_h, gaps_m, rectangle_corners
from trace_dag.common.paths import Path, TurnShape, straight, turned
from trace_dag.common.units import bearing_to_clock_h, clock_difference_h
from trace_dag.crash.codes.bodies import BODIES
from trace_dag.crash.vehicles import trailer_of
from trace_dag.reconstruction.motion.contact import Mover, find_contact_points, first_contacts


def outline(mover: Mover, time_s: float) -> shapely.Polygon:
    x, y, heading = (float(value) for value in mover.at(np.array(time_s)))
    return shapely.Polygon(rectangle_corners(Pose(x, y, heading), mover.length_m, mover.width_m))


lengths = st.floats(2.0, 20.0)
widths = st.floats(0.7, 2.6)


@given(st.floats(-8, 8), st.floats(-8, 8), st.floats(-math.pi, math.pi), lengths, widths, lengths, widths)
def test_separation_has_the_sign_shapely_finds(x, y, heading, length_1, width_1, length_2, width_2):
    zero = np.zeros(1)
    gap = float(
        gaps_m(
            (zero, zero, zero),
            (length_1, width_1),
            (np.array([x]), np.array([y]), np.array([heading])),
            (length_2, width_2),
        )[0]
    )
    one = shapely.Polygon(rectangle_corners(Pose(0, 0, 0), length_1, width_1))
    two = shapely.Polygon(rectangle_corners(Pose(x, y, heading), length_2, width_2))
    distance = one.distance(two)
    if gap > 1e-9:
        assert distance > 0
        assert gap <= distance + 1e-9
    elif gap < -1e-9:
        assert distance == 0


@settings(max_examples=60)
@given(
    st.floats(math.radians(-170), math.radians(170)),
    st.floats(0.5, 40),
    st.floats(0.5, 40),
    lengths,
    widths,
    lengths,
    widths,
)
def test_every_contact_is_a_first_touch(angle, speed_1, speed_2, length_1, width_1, length_2, width_2):
    one = Mover(straight(Pose(0, 0, 0), back_m=400, ahead_m=200), 400, speed_1, length_1, width_1)
    two = Mover(straight(Pose(0, 0, angle), back_m=400, ahead_m=200), 400, speed_2, length_2, width_2)
    contacts = first_contacts(one, two, timings=9)
    for index in range(len(contacts)):
        time_1, time_2 = contacts.time_1_s[index], contacts.time_2_s[index]
        body_1, body_2 = outline(one, time_1), outline(two, time_2)
        assert body_1.distance(body_2) <= 0.05
        assert body_1.intersection(body_2).area <= 1e-3
        for before in (0.02, 0.1, 0.5, 1.0, 3.0):
            assert not outline(one, time_1 - before).intersects(outline(two, time_2 - before))
        point = shapely.Point(contacts.x_m[index], contacts.y_m[index])
        assert body_1.distance(point) <= 0.2
        assert body_2.distance(point) <= 0.2


def test_crossing_at_right_angles_reaches_front_and_both_ends_of_the_side():
    one = Mover(straight(Pose(0, 0, 0), back_m=100, ahead_m=100), 100, 15, 4.8, 1.9)
    two = Mover(straight(Pose(0, 0, math.pi / 2), back_m=100, ahead_m=100), 100, 7, 4.8, 1.9)
    contacts = first_contacts(one, two, timings=61)
    struck = [
        bearing_to_clock_h(float(second))
        for first, second in zip(contacts.bearing_1_rad, contacts.bearing_2_rad, strict=True)
        if clock_difference_h(bearing_to_clock_h(float(first)), 12) < 0.1
    ]
    # Two heads north, one comes from its left: the left side, from the rear wheel to the front one.
    assert min(struck) < 8.5
    assert max(struck) > 9.5


def test_bearings_are_the_ones_the_verdict_measures():
    one = Mover(straight(Pose(0, 0, 0.3), back_m=100, ahead_m=100), 100, 15, 12.0, 2.5)
    two = Mover(straight(Pose(0, 0, 2.0), back_m=100, ahead_m=100), 100, 7, 2.2, 0.8)
    contacts = first_contacts(one, two, timings=11)
    assert len(contacts) > 3
    for index in range(len(contacts)):
        point = np.array([contacts.x_m[index], contacts.y_m[index]])
        for mover, time, bearing in (
            (one, contacts.time_1_s, contacts.bearing_1_rad),
            (two, contacts.time_2_s, contacts.bearing_2_rad),
        ):
            x, y, heading = (float(value) for value in mover.at(time[index]))
            clock = contact_clock_h(Pose(x, y, heading), mover.length_m, mover.width_m, point)
            assert clock_difference_h(clock, bearing_to_clock_h(float(bearing[index]))) < 1e-6


def test_a_standing_body_is_reached():
    one = Mover(straight(Pose(0, 0, 0), back_m=100, ahead_m=100), 100, 20, 4.8, 1.9)
    two = Mover(straight(Pose(0, 0, 0.2), back_m=10, ahead_m=10), 10, 0.0, 4.8, 1.9)
    contacts = first_contacts(one, two, timings=1)
    assert len(contacts) == 1


def test_two_standing_bodies_never_meet():
    one = Mover(straight(Pose(0, 0, 0), back_m=10, ahead_m=10), 10, 0.0, 4.8, 1.9)
    assert len(first_contacts(one, one, timings=5)) == 0


def test_a_backing_body_touches_with_its_rear():
    backing = Mover(straight(Pose(0, 0, 0), back_m=50, ahead_m=50), 50, 2.0, 4.8, 1.9, backing=True)
    standing = Mover(straight(Pose(0, 0, math.pi / 2), back_m=10, ahead_m=10), 10, 0.0, 4.8, 1.9)
    contacts = first_contacts(backing, standing, timings=1)
    assert bearing_to_clock_h(float(contacts.bearing_1_rad[0])) == pytest.approx(6.0, abs=0.2)


def test_a_turning_body_is_followed_along_its_curve():
    path = turned(
        straight(Pose(0, 0, 0), back_m=60, ahead_m=60), TurnShape(math.pi / 2, 12, 4), start_s_m=60, tail_m=40
    )
    turning = Mover(path, 75, 6.0, 4.8, 1.9)
    x, y, _, heading = (float(value) for value in path.at(np.array(75.0)))
    oncoming = Mover(straight(Pose(x, y, math.pi), back_m=150, ahead_m=50), 150, 15.0, 4.8, 1.9)
    assert heading > 0.3
    contacts = first_contacts(turning, oncoming, timings=21)
    assert len(contacts) > 5
    for index in range(len(contacts)):
        body_1 = outline(turning, contacts.time_1_s[index])
        body_2 = outline(oncoming, contacts.time_2_s[index])
        assert body_1.distance(body_2) <= 0.01
        assert body_1.intersection(body_2).area <= 1e-3


def test_a_trailer_behind_can_be_what_is_touched_first() -> None:
    """A car that comes from the right after the tractor has passed meets the side of its trailer, where the semitrailer
    of 16.15 m behind a tractor of 7 m is then; clock positions are those of both in line, 21.14 m."""
    trailer = trailer_of(BODIES["tractor_of_trailer"], 1)
    rig = Mover(straight(Pose(0, 0, 0), back_m=200, ahead_m=200), 212, 10.0, 7.0, 2.5, trailer=trailer)
    car = Mover(straight(Pose(0, 0, math.pi / 2), back_m=200, ahead_m=200), 200, 10.0, 4.8, 1.9)
    contacts = first_contacts(rig, car, timings=1)
    assert len(contacts) == 1
    assert contacts.y_m[0] == pytest.approx(-2.59 / 2, abs=0.05)
    # Both go at 10 m/s: the car's front is at the trailer's side 3.695 m before, and the tractor's front 3.5 m ahead.
    front_m = 12.0 + 3.5 - (1.295 + 2.4)
    assert contacts.x_m[0] == pytest.approx(0.0, abs=0.01)
    ahead_of_middle = (0.0 - (front_m - 21.14 / 2)) / 21.14
    assert contacts.bearing_1_rad[0] == pytest.approx(math.atan2(-0.5, ahead_of_middle), abs=0.02)


def test_one_who_stands_in_a_bend_has_its_trailer_along_the_bend() -> None:
    """Behind a tractor that is half way round a bend the trailer has hardly turned: a car that comes along the old
    street behind it meets the trailer's rear."""
    trailer = trailer_of(BODIES["tractor_of_trailer"], 1)
    assert trailer is not None
    s = np.arange(0.0, 120.0, 0.5)
    bend_rad = np.clip((s - 80.0) / 20.0, 0.0, math.pi / 2)
    x = 20.0 * np.sin(bend_rad) + np.minimum(s - 80.0, 0.0)
    y = 20.0 * (1.0 - np.cos(bend_rad)) + np.maximum(s - 80.0 - 10 * math.pi, 0.0)
    rig = Mover(Path(s, x, y, 0 * s, bend_rad), 98.0, 0.0, 7.0, 2.5, trailer=trailer)
    tractor, behind = rig.shapes_at(np.zeros(1))
    assert float(tractor.poses[2][0]) == pytest.approx(0.9, abs=0.01)
    assert 0.2 < float(tractor.poses[2][0] - behind.poses[2][0]) < 0.9
    car = Mover(straight(Pose(0, 0, 0), back_m=100, ahead_m=100), 100, 15.0, 4.8, 1.9)
    contacts = first_contacts(car, rig, timings=1)
    assert len(contacts) == 1
    assert abs(contacts.bearing_2_rad[0]) > math.radians(120)


@pytest.mark.parametrize("last_bit", [-1e-16, -1e-12, 0.0, 1e-12, 1e-16, 2 * math.pi])
def test_straight_ahead_is_twelve_oclock_whatever_its_last_bit_is(last_bit: float) -> None:
    assert bearing_to_clock_h(last_bit) == 12.0
    assert bearing_to_clock_h(last_bit + math.pi / 2) == pytest.approx(9.0, abs=1e-9)


@pytest.mark.parametrize("off_m", [-1e-12, 0.0, 1e-12])
def test_last_bits_do_not_move_a_contact_to_one_side(off_m: float) -> None:
    """A car of 1.84 m and one of 2.04 m meet in line: the outer corners are as far out as corners still touch."""
    one = (np.zeros(1), np.zeros(1), np.zeros(1))
    two = (np.array([5.0]), np.array([off_m]), np.array([math.pi]))
    touch = find_contact_points(one, (5.0, 1.84), two, (5.0, 2.04))
    assert [touch.x_m[0], touch.y_m[0], touch.bearing_1_rad[0], touch.bearing_2_rad[0]] == pytest.approx(
        [2.5, 0.0, 0.0, 0.0], abs=1e-9
    )
