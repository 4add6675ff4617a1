"""Crashes away from crossings: head-on, rear-end, sideswipes, backing, driveways, U-turn, freeway, bridge, tunnel."""

from __future__ import annotations

from make import bodies
from make.crash import Approach, Crash, Unit, meeting, swerve
from make.curves import rounded
from make.motion import Speed
from make.plane import plane_points
from make.roads import Road


def crashes(r: dict[str, Road]) -> list[Crash]:
    """All of them."""
    return [*_opposite(r), *_rear_end(r), *_sideswipe(r), *_access(r), *_backing(r)]


def _opposite(r: dict[str, Road]) -> list[Crash]:
    out = []
    east, west = Approach(r["main_west"], 1, 1, (-850, 0)), Approach(r["main_west"], -1, 1, (-850, 0))
    over = swerve(east.curve(), (-850, -1.8), [(-70, 0.0), (-4, 3.2), (50, 3.5)])
    out.append(Crash(
        22, "Across the centre line of the straight highway", (
            Unit(bodies.SEDAN, east, Speed(55), 50, 1, 10, "cross_centreline", over, (-850, 0), location=2,
                 before=(68,)),
            Unit(bodies.PICKUP, west, Speed(50), 51, 1, 62, "straight", west.curve(), (-850, 0)),
        ), 2, 1, 1, ("NE-411", ""), when=(1, 28, 23, 16), light=2,
    ))  # fmt: skip

    bend = (-1292, 24)
    west, east = Approach(r["main_west"], -1, 1, bend), Approach(r["main_west"], 1, 1, bend)
    over = swerve(west.curve(), bend, [(-72, 0.0), (-3, 3.3), (40, 3.5)])
    out.append(Crash(
        23, "Out of the curve into a dump truck", (
            Unit(bodies.SUV, west, Speed(57), 50, 14, 10, "cross_centreline", over, bend, location=2, before=(68,),
                 alignment=2),
            Unit(bodies.DUMP_TRUCK, east, Speed(50), 51, 14, 62, "curve", east.curve(), bend, alignment=3),
        ), 2, 1, 1, ("NE-411", ""), when=(2, 11, 5, 39), light=2, weather=10,
    ))  # fmt: skip

    wrong = Approach(r["meridian_north"], 1, 1, (1009, -230), wrong_way=True)
    right = Approach(r["meridian_north"], 1, 1, (1009, -230))
    out.append(Crash(
        24, "Wrong way on the divided parkway", (
            Unit(bodies.COMPACT, wrong, Speed(48), 50, 1, 54, "wrong_way", wrong.curve(), (1009, -230)),
            Unit(bodies.LARGE_SUV, right, Speed(45), 51, 1, 54, "straight", right.curve(), (1009, -230)),
        ), 2, 1, 1, ("MERIDIAN PKWY", ""), when=(3, 12, 2, 27), light=2,
    ))  # fmt: skip

    wrong = Approach(r["cedar"], 1, 1, (0, 95), wrong_way=True)
    right = Approach(r["cedar"], 1, 1, (0, 95))
    out.append(Crash(
        25, "Wrong way on one-way Cedar Street", (
            Unit(bodies.SEDAN, wrong, Speed(25), 50, 1, 54, "wrong_way", wrong.curve(), (0, 80)),
            Unit(bodies.WAGON, right, Speed(30), 51, 1, 54, "straight", right.curve(), (0, 80)),
        ), 2, 1, 1, ("CEDAR ST", ""), when=(4, 1, 1, 50), light=3,
    ))  # fmt: skip

    south, north = Approach(r["harrow"], -1, 1, (-700, 800)), Approach(r["harrow"], 1, 1, (-700, 800))
    over = swerve(south.curve(), (-700, 800), [(-65, 0.0), (-3, 3.1), (40, 3.3)])
    out.append(Crash(
        26, "Head-on on the Harrow Road bridge", (
            Unit(bodies.PICKUP, south, Speed(52), 50, 1, 10, "cross_centreline", over, (-700, 800), location=2,
                 before=(68,)),
            Unit(bodies.SEDAN, north, Speed(47), 51, 1, 62, "straight", north.curve(), (-700, 800)),
        ), 2, 1, 1, ("HARROW RD", ""), when=(1, 7, 18, 3), light=2, layer=1,
    ))  # fmt: skip

    north, south = Approach(r["harrow"], 1, 1, (-700, 1020)), Approach(r["harrow"], -1, 1, (-700, 1020))
    over = swerve(north.curve(), (-700, 1020), [(-118, 0.0), (-50, 3.4), (60, 3.4)])
    out.append(Crash(
        27, "Passing on Harrow Road in front of oncoming traffic", (
            Unit(bodies.SUV, north, Speed(60), 50, 6, 10, "pass", over, (-700, 1020), location=2, before=(68,)),
            Unit(bodies.MINIVAN, south, Speed(48), 51, 1, 62, "straight", south.curve(), (-700, 1020)),
        ), 2, 1, 1, ("HARROW RD", ""), when=(7, 4, 16, 31),
    ))  # fmt: skip

    east, west = Approach(r["depot"], 1, 1, (262, -430)), Approach(r["depot"], -1, 1, (262, -430))
    over = swerve(west.curve(), (262, -428), [(-50, 0.0), (-3, 3.0), (40, 3.3)])
    out.append(Crash(
        28, "Head-on on Depot Avenue, above the tunnel", (
            Unit(bodies.WAGON, west, Speed(38), 50, 1, 10, "cross_centreline", over, (262, -430), location=2,
                 before=(68,)),
            Unit(bodies.COMPACT, east, Speed(34), 51, 1, 62, "straight", east.curve(), (262, -430)),
        ), 2, 1, 1, ("DEPOT AVE", ""), when=(12, 24, 20, 9), light=2,
    ))  # fmt: skip

    bend = (-1178, -93)
    west, east = Approach(r["old_mill"], 1, 1, bend), Approach(r["old_mill"], -1, 1, bend)
    over = swerve(west.curve(), bend, [(-60, 0.0), (-3, 2.9), (40, 3.2)])
    out.append(Crash(
        29, "In the bend of Old Mill Road, speeds unknown, manner not reported", (
            Unit(bodies.PICKUP, west, Speed(46), 50, 14, 10, "cross_centreline", over, bend, location=2, before=(68,),
                 alignment=2, travel_speed_code=999),
            Unit(bodies.HATCHBACK, east, Speed(42), 51, 14, 62, "curve", east.curve(), bend, alignment=3,
                 travel_speed_code=999),
        ), 98, 1, 1, ("OLD MILL RD", ""), when=(9, 16, 3, 11), light=2,
    ))  # fmt: skip

    spot = (-1480, -129)
    west, east = Approach(r["old_mill"], 1, 1, spot), Approach(r["old_mill"], -1, 1, spot)
    over = swerve(west.curve(), spot, [(-106, 0.0), (-71, -2.6), (-60, -2.6), (-3, 3.1), (40, 3.3)])
    out.append(Crash(
        30, "Off the right edge, against a mailbox, back and across the centre line", (
            Unit(bodies.COMPACT, west, Speed(48), 98, 1, 13, "cross_centreline", over, spot, location=6,
                 before=(63, -53, 69, 68)),
            Unit(bodies.LARGE_SUV, east, Speed(46), 98, 1, 62, "straight", east.curve(), spot),
        ), 0, 1, 1, ("OLD MILL RD", ""), when=(10, 21, 21, 58), light=2, other_harmful_first=(1, 53),
        relation_to_road=4,
    ))  # fmt: skip
    return out


def _rear_end(r: dict[str, Road]) -> list[Crash]:
    out = []
    lane = Approach(r["freeway_east"], 1, 2, (-700, 789))
    out.append(Crash(
        31, "Into a tractor-trailer on the freeway, under the Harrow Road bridge", (
            Unit(bodies.HATCHBACK, lane, Speed(80), 24, 1, 51, "straight", lane.curve(), (-656, 787)),
            Unit(bodies.TRACTOR_TRAILER, lane, Speed(58), 25, 1, 53, "straight", lane.curve(), (-649, 787)),
        ), 1, 1, 1, ("I-780", ""), when=(5, 27, 4, 6), light=2,
    ))  # fmt: skip

    lane = Approach(r["elder"], 1, 1, (260, -430))
    out.append(Crash(
        32, "Into a slower car in the tunnel of Elder Street", (
            Unit(bodies.SUV, lane, Speed(42), 24, 1, 51, "straight", lane.curve(), (261.8, -428)),
            Unit(bodies.COMPACT, lane, Speed(20), 25, 1, 53, "straight", lane.curve(), (261.8, -428)),
        ), 1, 1, 1, ("ELDER ST", ""), when=(6, 23, 12, 47), light=3, layer=-1,
    ))  # fmt: skip

    lane = Approach(r["main_west"], 1, 1, (-620, 0))
    out.append(Crash(
        33, "Braking too late behind a car slowing down", (
            Unit(bodies.PICKUP, lane, Speed(56, -6.0, 0.9), 28, 1, 52, "straight", lane.curve(), (-620, -1.8),
                 avoidance=16),
            Unit(bodies.SEDAN, lane, Speed(45, -2.5, 2.4), 29, 2, 18, "straight", lane.curve(), (-620, -1.8), 9.0),
        ), 1, 1, 1, ("NE-411", ""), when=(8, 3, 17, 19),
    ))  # fmt: skip

    lane = Approach(r["main_west"], -1, 1, (-860, 0))
    out.append(Crash(
        34, "Into a school bus that stopped on the highway", (
            Unit(bodies.PICKUP, lane, Speed(51), 20, 1, 50, "straight", lane.curve(), (-860, 1.8)),
            Unit(bodies.SCHOOL_BUS, lane, Speed(0), 21, 5, 53, "stopped", lane.curve(), (-860, 1.8), avoidance=1),
        ), 1, 1, 1, ("NE-411", ""), when=(10, 4, 7, 34),
    ))  # fmt: skip

    lane = Approach(r["ramp_east_off"], 1, 1, (800, 736))
    out.append(Crash(
        35, "Too fast on the exit ramp", (
            Unit(bodies.SEDAN, lane, Speed(60), 24, 1, 51, "straight", lane.curve(), (800, 736)),
            Unit(bodies.BOX_TRUCK, lane, Speed(28), 25, 1, 53, "straight", lane.curve(), (800, 736)),
        ), 1, 1, 20, ("I-780 RAMP", ""), when=(11, 25, 22, 14), light=2, interchange=1,
    ))  # fmt: skip

    lane = Approach(r["main_east"], 1, 1, (720, 0))
    out.append(Crash(
        36, "Motorcycle into a slower pickup on East Main", (
            Unit(bodies.MOTORCYCLE, lane, Speed(55), 24, 1, 51, "straight", lane.curve(), (720, -3.5)),
            Unit(bodies.PICKUP, lane, Speed(31), 25, 1, 53, "straight", lane.curve(), (720, -3.5)),
        ), 1, 1, 1, ("E MAIN ST", ""), when=(9, 2, 19, 55), light=5,
    ))  # fmt: skip
    return out


def _sideswipe(r: dict[str, Road]) -> list[Crash]:
    out = []
    left, right = Approach(r["freeway_west"], 1, 1, (-100, 811)), Approach(r["freeway_west"], 1, 2, (-100, 811))
    change = swerve(left.curve(), (-100, 811), [(-65, 0.0), (20, -3.2), (60, -3.4)])
    out.append(Crash(
        37, "Lane change to the right on the freeway", (
            Unit(bodies.SUV, left, Speed(76), 46, 15, 11, "lane_change_right", change, (-100, 811), 1.0, location=2),
            Unit(bodies.MINIVAN, right, Speed(70), 45, 1, 60, "straight", right.curve(), (-100, 811)),
        ), 7, 1, 1, ("I-780", ""), when=(3, 19, 14, 52),
    ))  # fmt: skip

    left, right = Approach(r["freeway_west"], 1, 1, (-1000, 811)), Approach(r["freeway_west"], 1, 2, (-1000, 811))
    change = swerve(left.curve(), (-1000, 811), [(-65, 0.0), (20, -3.2), (60, -3.4)])
    out.append(Crash(
        47, "Pushed off the freeway by a lane change, and into the guardrail", (
            Unit(bodies.PICKUP, left, Speed(74), 46, 15, 11, "lane_change_right", change, (-1000, 811), 1.0,
                 location=2),
            Unit(bodies.COMPACT, right, Speed(68), 45, 1, 60, "straight", right.curve(), (-1000, 811)),
        ), 7, 1, 1, ("I-780", ""), when=(9, 8, 23, 10), light=2, afterwards=((2, 63, 55), (2, 24, 1)),
    ))  # fmt: skip

    right, left = Approach(r["main_east"], -1, 2, (760, 0)), Approach(r["main_east"], -1, 1, (760, 0))
    change = swerve(right.curve(), (760, 7), [(-40, 0.0), (14, 3.0), (50, 3.3)])
    out.append(Crash(
        38, "Lane change to the left on East Main", (
            Unit(bodies.PICKUP, right, Speed(36), 47, 15, 10, "lane_change_left", change, (760, 0), 0.8, location=2),
            Unit(bodies.MOTORCYCLE, left, Speed(41), 45, 1, 61, "straight", left.curve(), (760, 0)),
        ), 7, 1, 1, ("E MAIN ST", ""), when=(6, 30, 18, 26),
    ))  # fmt: skip

    joining, right = Approach(r["freeway_east"], 1, 3, (1600, 789)), Approach(r["freeway_east"], 1, 2, (1600, 789))
    merge = swerve(joining.curve(), (1600, 783), [(-60, 0.0), (20, 3.0), (60, 3.5)])
    out.append(Crash(
        39, "Merging from the ramp against a tractor-trailer", (
            Unit(bodies.COMPACT, joining, Speed(59), 47, 16, 10, "merge", merge, (1600, 783), location=2),
            Unit(bodies.TRACTOR_TRAILER, right, Speed(64), 45, 1, 61, "straight", right.curve(), (1607, 787), 2.0),
        ), 7, 1, 17, ("I-780", ""), when=(7, 15, 15, 41), interchange=1,
    ))  # fmt: skip

    north, south = Approach(r["harrow"], 1, 1, (-700, 430)), Approach(r["harrow"], -1, 1, (-700, 430))
    drift = swerve(north.curve(), (-700, 430), [(-45, 0.0), (0, 1.72), (40, 1.9)])
    out.append(Crash(
        40, "Sideswipe of oncoming cars on Harrow Road", (
            Unit(bodies.SEDAN, north, Speed(50), 64, 1, 10, "cross_centreline", drift, (-700, 430), location=2,
                 before=(68,)),
            Unit(bodies.SUV, south, Speed(46), 65, 1, 62, "straight", south.curve(), (-700, 430)),
        ), 8, 1, 1, ("HARROW RD", ""), when=(4, 29, 6, 20),
    ))  # fmt: skip

    spot = (-1380, -118)
    east, west = Approach(r["old_mill"], -1, 1, spot), Approach(r["old_mill"], 1, 1, spot)
    drift = swerve(east.curve(), spot, [(-40, 0.0), (0, 1.95), (40, 2.2)])
    out.append(Crash(
        41, "Motorcycle over the centre line, sideswiped by a dump truck", (
            Unit(bodies.MOTORCYCLE, east, Speed(47), 64, 1, 10, "cross_centreline", drift, spot, location=2,
                 before=(68,)),
            Unit(bodies.DUMP_TRUCK, west, Speed(44), 65, 1, 62, "straight", west.curve(), spot),
        ), 8, 1, 1, ("OLD MILL RD", ""), when=(8, 19, 13, 13),
    ))  # fmt: skip
    return out


def _access(r: dict[str, Road]) -> list[Crash]:
    out = []
    right, left = Approach(r["main_east"], 1, 2, (750, 0)), Approach(r["main_east"], 1, 1, (750, 0))
    around = rounded(plane_points([(640, -7), (782, -7), (782, 7), (640, 7)]), 6.5)
    x = meeting(around, left.curve(), (781, -3.5))
    out.append(Crash(
        42, "U-turn from the right lane of East Main", (
            Unit(bodies.WAGON, right, Speed(12), 72, 12, 21, "u_turn", around, x, 1.0, location=2),
            Unit(bodies.SUV, left, Speed(38), 73, 1, 60, "straight", left.curve(), x),
        ), 6, 1, 1, ("E MAIN ST", ""), when=(5, 13, 11, 37),
    ))  # fmt: skip

    centre = Approach(r["main_east"], -1, 0, (500, 0))
    oncoming = Approach(r["main_east"], 1, 2, (450, 0))
    path = centre.turn(Approach(r["drive_diner"], 1, 0, (480, -40)), 6.0, (480, 0))
    x = meeting(path, oncoming.curve(), (480, -7))
    out.append(Crash(
        43, "Left into the diner's driveway across traffic", (
            Unit(bodies.PICKUP, centre, Speed(11), 68, 11, 15, "turn_left", path, x, 2.0),
            Unit(bodies.MOTORCYCLE, oncoming, Speed(39), 69, 1, 62, "straight", oncoming.curve(), x),
        ), 6, 1, 8, ("E MAIN ST", ""), when=(7, 29, 20, 2), light=5,
    ))  # fmt: skip

    drive = Approach(r["drive_market"], -1, 0, (860, 40))
    west = Approach(r["main_east"], -1, 2, (890, 0))
    path = drive.turn(Approach(r["main_east"], 1, 1, (880, 0)), 8.0, (860, 0))
    x = meeting(path, west.curve(), (860, 7))
    out.append(Crash(
        44, "Out of the market's driveway in front of traffic from the left", (
            Unit(bodies.HATCHBACK, drive, Speed(8), 82, 11, 15, "enter_from_driveway", path, x, 1.4, location=7),
            Unit(bodies.LARGE_SUV, west, Speed(39), 83, 1, 72, "straight", west.curve(), x),
        ), 6, 1, 8, ("E MAIN ST", ""), when=(12, 9, 17, 52), light=3,
    ))  # fmt: skip
    return out


def _backing(r: dict[str, Road]) -> list[Crash]:
    out = []
    drive = Approach(r["drive_dogwood"], -1, 0, (150, -60))
    back_out = rounded(plane_points([(158, -60), (120, -60)]))
    street = Approach(r["dogwood"], 1, 1, (130, -80))
    x = meeting(back_out, street.curve(), (131.6, -60))
    out.append(Crash(
        45, "Backing out of a driveway into the side of a motorcycle", (
            Unit(bodies.SEDAN, drive, Speed(5), 92, 13, 20, "backing", back_out, x, location=7, backing=True),
            Unit(bodies.MOTORCYCLE, street, Speed(26), 93, 1, 71, "straight", street.curve(), x, 14.9),
        ), 9, 1, 8, ("DOGWOOD ST", ""), when=(6, 17, 10, 28),
    ))  # fmt: skip

    drive, court = Approach(r["drive_alder"], -1, 0, (-240, -195)), Approach(r["garnet"], 1, 1, (-290, -195))
    westward = rounded(plane_points([(-232, -194.3), (-270, -194.3)]))
    eastward = rounded(plane_points([(-335, -194.0), (-250, -194.0)]))
    out.append(Crash(
        46, "Backing out of a driveway and out of the court opposite", (
            Unit(bodies.LARGE_SUV, drive, Speed(6), 92, 13, 20, "backing", westward, (-259, -195), location=7,
                 backing=True),
            Unit(bodies.PICKUP, court, Speed(5), 93, 13, 73, "backing", eastward, (-259, -195), backing=True,
                 control=20),
        ), 10, 3, 2, ("ALDER ST", "GARNET CT"), when=(12, 30, 15, 7),
    ))  # fmt: skip
    return out
