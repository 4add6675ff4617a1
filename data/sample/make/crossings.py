"""Crashes at crossings: four-way, T, Y, five-leg, roundabout, L, staggered, and the joined crossings of the parkway."""

from __future__ import annotations

from make import bodies
from make.crash import Approach, Crash, Unit, meeting, swerve
from make.curves import rounded
from make.motion import Speed
from make.plane import plane_points
from make.roads import Road

SIGNAL, STOP, YIELD = 3, 20, 21
RED_LIGHT = 31  # VIOLATION


def crashes(r: dict[str, Road]) -> list[Crash]:
    """All of them."""
    return [*_four_way(r), *_parkway(r), *_t(r), *_other(r)]


def _four_way(r: dict[str, Road]) -> list[Crash]:
    out = []
    birch = Approach(r["birch"], 1, 2, (-130, -30))
    main_east = Approach(r["main"], 1, 2, (-150, 0))
    x = meeting(birch.curve(), main_east.curve(), (-130, 0))
    out.append(Crash(
        1, "Red light at Main and Birch: struck on the right", (
            Unit(bodies.SEDAN, birch, Speed(38), 86, 1, 17, "straight", birch.curve(), x, control=SIGNAL,
                 charge=RED_LIGHT),
            Unit(bodies.SUV, main_east, Speed(30), 87, 1, 66, "straight", main_east.curve(), x, 1.5, control=SIGNAL),
        ), 6, 2, 2, ("BIRCH ST", "NE-411/MAIN ST"), when=(1, 13, 17, 42), light=3,
    ))  # fmt: skip

    sumner = Approach(r["sumner"], 1, 1, (100, -130))
    dogwood = Approach(r["dogwood"], -1, 1, (130, -100))
    x = meeting(sumner.curve(), dogwood.curve(), (130, -130))
    out.append(Crash(
        2, "Stop sign not heeded at Sumner and Dogwood: struck on the left", (
            Unit(bodies.COMPACT, sumner, Speed(15), 89, 1, 17, "straight", sumner.curve(), x, 1.9, control=STOP),
            Unit(bodies.PICKUP, dogwood, Speed(32), 88, 1, 66, "straight", dogwood.curve(), x, avoidance=1),
        ), 6, 2, 2, ("SUMNER AVE", "DOGWOOD ST"), when=(2, 4, 9, 5),
    ))  # fmt: skip

    main_left = Approach(r["main"], 1, 1, (235, 0))
    main_west = Approach(r["main"], -1, 2, (290, 0))
    path = main_left.turn(Approach(r["elder"], 1, 1, (260, 30)), 10.0, (260, 0))
    x = meeting(path, main_west.curve(), (260, 5))
    out.append(Crash(
        3, "Left turn across a motorcycle at Main and Elder", (
            Unit(bodies.SEDAN, main_left, Speed(14), 68, 11, 15, "turn_left", path, x, 2.0, control=SIGNAL),
            Unit(bodies.MOTORCYCLE, main_west, Speed(30), 69, 1, 62, "straight", main_west.curve(), x, control=SIGNAL),
        ), 6, 2, 2, ("NE-411/MAIN ST", "ELDER ST"), when=(5, 20, 21, 14), light=3,
    ))  # fmt: skip

    main_queue = Approach(r["main"], 1, 1, (-40, 0))
    out.append(Crash(
        4, "Bus waiting at the signal of Main and Cedar, struck from behind", (
            Unit(bodies.PICKUP, main_queue, Speed(36), 20, 1, 50, "straight", main_queue.curve(), (-14, -1.65),
                 control=SIGNAL),
            Unit(bodies.TRANSIT_BUS, main_queue, Speed(0), 21, 5, 53, "stopped", main_queue.curve(), (-14, -1.65),
                 avoidance=1, control=SIGNAL),
        ), 1, 2, 3, ("NE-411/MAIN ST", "CEDAR ST"), when=(3, 2, 7, 48),
    ))  # fmt: skip

    birch_left, birch_right = Approach(r["birch"], 1, 1, (-130, 100)), Approach(r["birch"], 1, 2, (-130, 100))
    path = birch_left.turn(Approach(r["quarry"], 1, 1, (-100, 130)), 9.0, (-130, 130))
    x = meeting(path, birch_right.curve(), (-130, 126))
    out.append(Crash(
        5, "Right turn from the left lane of one-way Birch Street", (
            Unit(bodies.MINIVAN, birch_left, Speed(13), 70, 10, 16, "turn_right", path, x, 1.5, location=2),
            Unit(bodies.HATCHBACK, birch_right, Speed(31), 71, 1, 60, "straight", birch_right.curve(), x),
        ), 6, 2, 2, ("BIRCH ST", "QUARRY AVE"), when=(7, 8, 13, 30),
    ))  # fmt: skip
    return out


def _parkway(r: dict[str, Road]) -> list[Crash]:
    out = []
    sedge = Approach(r["sedge"], 1, 1, (970, -400))
    south = Approach(r["meridian_south"], 1, 2, (991, -380))
    x = meeting(sedge.curve(), south.curve(), (990, -400))
    out.append(Crash(
        6, "Starting from the stop sign of Sedge Road into the near carriageway", (
            Unit(bodies.WAGON, sedge, Speed(0, 1.6, 3.4), 89, 4, 17, "starting", sedge.curve(), x, control=STOP,
                 speed_reported=False),
            Unit(bodies.LARGE_SUV, south, Speed(50), 88, 1, 66, "straight", south.curve(), x, 1.5, avoidance=1),
        ), 6, 2, 2, ("SEDGE RD", "MERIDIAN PKWY"), when=(8, 26, 16, 2),
    ))  # fmt: skip

    north = Approach(r["meridian_north"], 1, 2, (1009, -420))
    x = meeting(sedge.curve(), north.curve(), (1010, -401))
    out.append(Crash(
        7, "Across the median of the parkway into the far carriageway", (
            Unit(bodies.MINIVAN, sedge, Speed(18), 87, 1, 17, "straight", sedge.curve(), x, 1.2, control=STOP),
            Unit(bodies.BOX_TRUCK, north, Speed(48), 86, 1, 66, "straight", north.curve(), x),
        ), 6, 2, 2, ("SEDGE RD", "MERIDIAN PKWY"), when=(10, 11, 11, 25), weather=10,
    ))  # fmt: skip

    pocket = Approach(r["meridian_north"], 1, 1, (1009, -30))
    through = Approach(r["meridian_south"], 1, 2, (991, 40))
    path = pocket.turn(Approach(r["main_east"], -1, 1, (960, 0)), 15.0, (1000, 0))
    x = meeting(path, through.curve(), (989, 3))
    out.append(Crash(
        8, "Left turn across the far carriageway at Main and the parkway", (
            Unit(bodies.SUV, pocket, Speed(16), 68, 11, 15, "turn_left", path, x, 1.5, control=SIGNAL),
            Unit(bodies.SEDAN, through, Speed(47), 69, 1, 62, "straight", through.curve(), x, control=SIGNAL),
        ), 6, 2, 2, ("MERIDIAN PKWY", "E MAIN ST"), when=(11, 3, 18, 37), light=3,
    ))  # fmt: skip
    return out


def _t(r: dict[str, Road]) -> list[Crash]:
    out = []
    harrow = Approach(r["harrow"], -1, 1, (-700, 30))
    west = Approach(r["main_west"], -1, 1, (-650, 0))
    east = Approach(r["main_west"], 1, 1, (-740, 0))
    path = harrow.turn(east, 10.0, (-700, 0))
    x = meeting(path, west.curve(), (-699, 2))
    out.append(Crash(
        9, "Left turn out of Harrow Road in front of traffic from the left", (
            Unit(bodies.HATCHBACK, harrow, Speed(12), 82, 11, 15, "turn_left", path, x, 1.5, control=STOP),
            Unit(bodies.PICKUP, west, Speed(52), 83, 1, 67, "straight", west.curve(), x),
        ), 6, 3, 2, ("NE-411", "HARROW RD"), when=(4, 17, 6, 55), light=4,
    ))  # fmt: skip

    x = meeting(path, east.curve(), (-694, -2))
    out.append(Crash(
        10, "Left turn out of Harrow Road into the path of traffic from the right", (
            Unit(bodies.SUV, harrow, Speed(15), 76, 11, 15, "turn_left", path, (-696.5, 0.5), 1.0, control=STOP),
            Unit(bodies.SEDAN, east, Speed(55), 77, 1, 65, "straight", east.curve(), (-697.5, -1.8)),
        ), 6, 3, 2, ("NE-411", "HARROW RD"), when=(9, 9, 14, 12),
    ))  # fmt: skip

    centre = Approach(r["main_east"], 1, 0, (630, 0))
    oncoming = Approach(r["main_east"], -1, 2, (690, 0))
    path = centre.turn(Approach(r["fern"], 1, 1, (650, 40)), 9.0, (650, 0))
    x = meeting(path, oncoming.curve(), (650, 7))
    out.append(Crash(
        11, "Left turn from the shared centre lane into Fern Lane", (
            Unit(bodies.MINIVAN, centre, Speed(13), 68, 11, 15, "turn_left", path, x, 2.0),
            Unit(bodies.SUV, oncoming, Speed(40), 69, 1, 62, "straight", oncoming.curve(), x),
        ), 6, 3, 2, ("E MAIN ST", "FERN LN"), when=(6, 1, 8, 20),
    ))  # fmt: skip

    fern = Approach(r["fern"], -1, 1, (650, 40))
    path = fern.turn(oncoming, 8.0, (650, 7))
    out.append(Crash(
        12, "Right turn out of Fern Lane in front of traffic from the left", (
            Unit(bodies.COMPACT, fern, Speed(12), 78, 10, 16, "turn_right", path, (645.0, 7.5), 1.0, control=STOP),
            Unit(bodies.PICKUP, oncoming, Speed(41), 79, 1, 65, "straight", oncoming.curve(), (645.0, 7.0)),
        ), 6, 3, 2, ("E MAIN ST", "FERN LN"), when=(12, 5, 17, 8), light=3,
    ))  # fmt: skip

    depot = Approach(r["alder"], -1, 1, (-260, -400))
    depot_west = Approach(r["depot"], -1, 1, (-200, -430))
    path = depot.turn(Approach(r["depot"], 1, 1, (-220, -430)), 9.0, (-260, -430))
    x = meeting(path, depot_west.curve(), (-259, -428))
    out.append(Crash(
        13, "Motorcycle turning left out of Alder Street, struck on its left side", (
            Unit(bodies.MOTORCYCLE, depot, Speed(13), 82, 11, 15, "turn_left", path, x, 0.6, control=STOP),
            Unit(bodies.WAGON, depot_west, Speed(36), 83, 1, 67, "straight", depot_west.curve(), x),
        ), 6, 3, 2, ("DEPOT AVE", "ALDER ST"), when=(7, 22, 20, 40), light=5,
    ))  # fmt: skip
    return out


def _other(r: dict[str, Road]) -> list[Crash]:
    out = []
    west = Approach(r["main_west"], -1, 1, (-960, 0))
    east = Approach(r["main_west"], 1, 1, (-1050, 0))
    mill_out = Approach(r["old_mill"], 1, 1, (-1040, -21))
    path = west.turn(mill_out, 60.0, (-1000, 0))
    x = meeting(path, east.curve(), (-1008, -2))
    out.append(Crash(
        14, "Left into Old Mill Road at the Y, across oncoming traffic", (
            Unit(bodies.WAGON, west, Speed(25), 68, 11, 15, "turn_left", path, x, 6.5),
            Unit(bodies.SEDAN, east, Speed(54), 69, 1, 62, "straight", east.curve(), x),
        ), 6, 4, 2, ("NE-411", "OLD MILL RD"), when=(3, 25, 15, 33),
    ))  # fmt: skip

    mill_in = Approach(r["old_mill"], -1, 1, (-1040, -21))
    path = mill_in.turn(east, 45.0, (-1000, 0))
    out.append(Crash(
        15, "From Old Mill Road into the path of traffic at the Y", (
            Unit(bodies.COMPACT, mill_in, Speed(25), 78, 10, 16, "turn_right", path, (-1000, -2.6), control=STOP),
            Unit(bodies.BOX_TRUCK, east, Speed(53), 79, 1, 65, "straight", east.curve(), (-1000, -1.8), -1.0),
        ), 6, 4, 2, ("NE-411", "OLD MILL RD"), when=(10, 30, 7, 15), light=4,
    ))  # fmt: skip

    alder = Approach(r["alder"], 1, 1, (-260, 240))
    prospect_east = Approach(r["prospect"], 1, 1, (-300, 260))
    x = meeting(alder.curve(), prospect_east.curve(), (-258, 258))
    out.append(Crash(
        16, "Straight across the five-leg crossing, struck on the left", (
            Unit(bodies.COMPACT, alder, Speed(16), 89, 1, 17, "straight", alder.curve(), x, 1.9, control=STOP),
            Unit(bodies.WAGON, prospect_east, Speed(33), 88, 1, 66, "straight", prospect_east.curve(), x),
        ), 6, 7, 2, ("ALDER ST", "PROSPECT AVE"), when=(5, 5, 12, 18),
    ))  # fmt: skip

    beacon = Approach(r["beacon"], -1, 1, (-285, 285))
    prospect_west = Approach(r["prospect"], -1, 1, (-220, 260))
    path = beacon.turn(Approach(r["prospect"], 1, 1, (-220, 260)), 22.0, (-260, 260))
    x = meeting(path, prospect_west.curve(), (-260, 262))
    out.append(Crash(
        17, "From Beacon Road left into Prospect Avenue at the five-leg crossing", (
            Unit(bodies.SUV, beacon, Speed(17), 82, 11, 15, "turn_left", path, x, 2.0, control=STOP),
            Unit(bodies.SEDAN, prospect_west, Speed(31), 83, 1, 67, "straight", prospect_west.curve(), x),
        ), 6, 7, 2, ("PROSPECT AVE", "BEACON RD"), when=(8, 13, 22, 50), light=3,
    ))  # fmt: skip

    elder = Approach(r["elder"], 1, 1, (260, 440))
    into_ring = rounded(plane_points([(261.7, 300), (261.7, 465), (300, 471)]), 12.0)
    # Along the entry flare, then round the ring of 18 m radius.
    around = rounded(
        plane_points(
            [(110, 478.3), (204, 478.3), (224, 477), (240.22, 474.31), (253.21, 461.34), (269.93, 462.80), (286.2, 486)]
        ),
        {1: 80.0, 2: 60.0, 3: 12.0, 4: 18.0, 5: 18.0},
    )
    flare = Approach(r["linden_west_in"], 1, 1, (230, 476))
    x = meeting(into_ring, around, (261.7, 463))
    out.append(Crash(
        18, "Entering the roundabout without yielding", (
            Unit(bodies.SEDAN, elder, Speed(22), 78, 10, 16, "turn_right", into_ring, x, control=YIELD),
            Unit(bodies.HATCHBACK, flare, Speed(17), 79, 14, 65, "curve", around, x, 1.2, alignment=3),
        ), 6, 6, 2, ("ELDER ST", "LINDEN DR"), when=(9, 30, 10, 10),
    ))  # fmt: skip

    to_ring = rounded(plane_points([(450, 481.7), (318, 481.7), (296, 483.1), (277, 486.2)]), 40.0)
    linden, flare = Approach(r["linden_east"], -1, 1, (330, 480)), Approach(r["linden_east_in"], 1, 1, (292, 484))
    out.append(Crash(
        19, "Waiting at the roundabout, struck from behind", (
            Unit(bodies.LARGE_SUV, linden, Speed(30), 20, 1, 50, "straight", to_ring, (290, 484), avoidance=1),
            Unit(bodies.COMPACT, flare, Speed(0), 21, 5, 53, "stopped", to_ring, (290, 484), avoidance=1,
                 control=YIELD),
        ), 1, 6, 3, ("LINDEN DR", "ELDER ST"), when=(11, 18, 16, 44),
    ))  # fmt: skip

    cottonwood = Approach(r["cottonwood"], -1, 1, (-520, -230))
    tallow = Approach(r["tallow"], -1, 1, (-490, -260))
    wide = tallow.turn(Approach(r["cottonwood"], 1, 1, (-520, -230)), 6.5, (-520, -260))
    proper = cottonwood.turn(Approach(r["tallow"], 1, 1, (-490, -260)), 9.0, (-520, -260))
    cut = swerve(proper, (-519, -259), [(-16, 0.0), (-4, 2.9), (4, 2.9), (18, 0.0)])
    out.append(Crash(
        20, "Cutting the corner of Cottonwood Lane and Tallow Avenue", (
            Unit(bodies.PICKUP, cottonwood, Speed(18), 50, 11, 10, "turn_left", cut, (-519, -258), location=2,
                 before=(68,)),
            Unit(bodies.COMPACT, tallow, Speed(13), 51, 10, 62, "turn_right", wide, (-518, -258), 4.0),
        ), 2, 10, 2, ("COTTONWOOD LN", "TALLOW AVE"), when=(12, 16, 19, 21), light=2,
    ))  # fmt: skip

    mill = Approach(r["south_mill"], -1, 1, (-405, 230))
    path = mill.turn(Approach(r["prospect"], -1, 1, (-440, 260)), 9.0, (-405, 260))
    prospect_east = Approach(r["prospect"], 1, 1, (-440, 260))
    x = meeting(path, prospect_east.curve(), (-404, 258))
    out.append(Crash(
        21, "Left turn out of South Mill Lane at the staggered crossing", (
            Unit(bodies.MINIVAN, mill, Speed(12), 82, 11, 15, "turn_left", path, x, 1.5, control=STOP),
            Unit(bodies.SUV, prospect_east, Speed(35), 83, 1, 67, "straight", prospect_east.curve(), x),
        ), 6, 11, 2, ("PROSPECT AVE", "S MILL LN"), when=(2, 19, 13, 5),
    ))  # fmt: skip
    return out
