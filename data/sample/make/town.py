"""Merrow, the fictional town: every road, crossing and sign, some houses, on the plan of :mod:`make.plane`."""

from __future__ import annotations

from make.osm_file import OsmFile
from make.roads import Road, one_way, two_way

_SURFACE = {"surface": "asphalt"}


def roads() -> dict[str, Road]:
    """All roads by key."""
    every = [*_highway(), *_downtown(), *_north(), *_south(), *_parkway(), *_freeway()]
    return {road.key: road for road in every}


def _highway() -> list[Road]:
    """NE 411, which is Main Street in town, and the rural roads that meet it in the west."""
    rural = two_way(3.6, lanes="2", maxspeed="55 mph", shoulder="yes")
    edge = two_way(3.6, lanes="2", maxspeed="35 mph")
    downtown = two_way(3.3, 2, 2, lanes="4", maxspeed="30 mph", sidewalk="both")
    shared_centre = two_way(
        3.5, 2, 2, centre_m=3.5, lanes="5", lanes__forward="2", lanes__backward="2", lanes__both_ways="1",
        turn__lanes__both_ways="left", maxspeed="35 mph",
    )  # fmt: skip
    pocket_eastbound = two_way(
        3.5, 3, 2, lanes="5", lanes__forward="3", lanes__backward="2",
        turn__lanes__forward="left|through|through;right", maxspeed="35 mph",
    )  # fmt: skip
    pocket_westbound = two_way(
        3.5, 2, 3, lanes="5", lanes__forward="2", lanes__backward="3",
        turn__lanes__backward="left|through|through;right", maxspeed="35 mph",
    )  # fmt: skip
    main_west = Road.along(
        "main_west", [(-1850, 420), (-1300, 0), (-330, 0)], [((-430, 0), rural), (None, edge)], radii={1: 350.0},
        highway="secondary", name="Main Street", ref="NE 411", reported_as="NE-411", **_SURFACE,
    )  # fmt: skip
    main = Road.along(
        "main", [(-330, 0), (330, 0)], [(None, downtown)],
        highway="secondary", name="Main Street", ref="NE 411", reported_as="NE-411/MAIN ST", **_SURFACE,
    )  # fmt: skip
    main_east = Road.along(
        "main_east", [(330, 0), (1600, 0)],
        [((920, 0), shared_centre), ((1000, 0), pocket_eastbound), ((1080, 0), pocket_westbound),
         (None, shared_centre)],
        highway="secondary", name="East Main Street", ref="NE 411", reported_as="E MAIN ST", trafficway=5, **_SURFACE,
    )  # fmt: skip
    old_mill = Road.along(
        "old_mill", [(-1000, 0), (-1180, -95), (-1750, -160)], [(None, two_way(3.4, lanes="2", maxspeed="50 mph"))],
        radii={1: 150.0}, highway="tertiary", name="Old Mill Road", alt_name="County Road 14",
        reported_as="OLD MILL RD", **_SURFACE,
    )  # fmt: skip
    plain = two_way(3.4, lanes="2", maxspeed="50 mph")
    over = two_way(3.4, lanes="2", maxspeed="50 mph", bridge="yes", layer="1", width="8.2")
    harrow = Road.along(
        "harrow", [(-700, 0), (-700, 1300)], [((-700, 765), plain), ((-700, 835), over), (None, plain)],
        highway="tertiary", name="Harrow Road", reported_as="HARROW RD", **_SURFACE,
    )  # fmt: skip
    return [main_west, main, main_east, old_mill, harrow]


def _downtown() -> list[Road]:
    """The grid: a one-way couplet, residential streets, a five-leg crossing in the north-west."""
    workspace = two_way(3.3, maxspeed="25 mph")
    home_lanes = two_way(3.3, lanes="2", maxspeed="25 mph", sidewalk="both")
    collector = two_way(3.4, lanes="2", maxspeed="30 mph")
    couplet = one_way(3.4, 2, lanes="2", maxspeed="30 mph")
    couplet_turn = one_way(3.4, 2, lanes="2", maxspeed="30 mph", turn__lanes="left;through|through;right")
    common = {"highway": "residential", **_SURFACE}
    return [
        Road.along("alder", [(-260, -430), (-260, 480)], [(None, home_lanes)], name="Alder Street",
                   reported_as="ALDER ST", **common),
        Road.along("birch", [(-130, -260), (-130, 260)],
                   [((-130, -60), couplet), ((-130, 0), couplet_turn), (None, couplet)], name="Birch Street",
                   ref="NE 97", highway="tertiary", surface="asphalt", reported_as="BIRCH ST", trafficway=4),
        Road.along("cedar", [(0, 260), (0, -260)], [((0, 60), couplet), ((0, 0), couplet_turn), (None, couplet)],
                   name="Cedar Street", ref="NE 97", highway="tertiary", surface="concrete", reported_as="CEDAR ST",
                   trafficway=4),
        Road.along("dogwood", [(130, -260), (130, 260)], [(None, workspace)], name="Dogwood Street",
                   reported_as="DOGWOOD ST", **common),
        Road.along("tallow", [(-520, -260), (260, -260)], [(None, workspace)], name="Tallow Avenue",
                   reported_as="TALLOW AVE", **common),
        Road.along("cottonwood", [(-520, -260), (-520, 0)], [(None, workspace)], name="Cottonwood Lane",
                   reported_as="COTTONWOOD LN", **common),
        Road.along("sumner", [(-260, -130), (260, -130)], [(None, home_lanes)], name="Sumner Avenue",
                   reported_as="SUMNER AVE", **common),
        Road.along("quarry", [(-260, 130), (560, 130)], [(None, home_lanes)], name="Quarry Avenue",
                   reported_as="QUARRY AVE", **common),
        Road.along("prospect", [(-560, 260), (560, 260)], [(None, collector)], name="Prospect Avenue",
                   highway="tertiary", surface="asphalt", reported_as="PROSPECT AVE"),
        Road.along("beacon", [(-260, 260), (-620, 620)], [(None, two_way(3.4, lanes="2", maxspeed="40 mph"))],
                   name="Beacon Road", highway="tertiary", surface="asphalt", reported_as="BEACON RD"),
        Road.along("north_mill", [(-420, 260), (-420, 410)], [(None, workspace)], name="North Mill Lane",
                   reported_as="N MILL LN", **common),
        Road.along("south_mill", [(-405, 260), (-405, 110)], [(None, workspace)], name="South Mill Lane",
                   reported_as="S MILL LN", **common),
    ]  # fmt: skip


def _north() -> list[Road]:
    """The roundabout and the streets around it."""
    lane = two_way(3.4, lanes="2", maxspeed="30 mph")
    ring = one_way(5.0, lanes="1", maxspeed="20 mph", junction="roundabout")
    flare = one_way(3.8, lanes="1", maxspeed="30 mph")
    workspace = two_way(3.3, maxspeed="25 mph")
    linden = {"highway": "tertiary", "name": "Linden Drive", "reported_as": "LINDEN DR", **_SURFACE}
    flares = {"sections": [(None, flare)], "trafficway": 2, **linden}
    # 20 degrees either side of the leg, on the ring of 18 m radius about (260, 480).
    a, b = 16.9145, 6.1564
    return [
        Road.circle("ring", (260, 480), 18.0, ring, highway="tertiary", **_SURFACE),
        Road.along("elder_north", [(260, 498), (260, 720)], [(None, lane)], name="Elder Street", highway="tertiary",
                   reported_as="ELDER ST", **_SURFACE),
        Road.along("linden_west", [(-260, 480), (204, 480)], [(None, lane)], **linden),
        Road.along("linden_west_in", [(204, 480), (224, 477), (260 - a, 480 - b)], **flares),
        Road.along("linden_west_out", [(260 - a, 480 + b), (224, 483), (204, 480)], **flares),
        Road.along("linden_east", [(316, 480), (560, 480)], [(None, lane)], **linden),
        Road.along("linden_east_in", [(316, 480), (296, 483), (260 + a, 480 + b)], **flares),
        Road.along("linden_east_out", [(260 + a, 480 - b), (296, 477), (316, 480)], **flares),
        Road.along("gable", [(560, 130), (560, 480)], [(None, workspace)], name="Gable Street", highway="residential",
                   reported_as="GABLE ST", **_SURFACE),
    ]  # fmt: skip


def _south() -> list[Road]:
    """Elder Street and its tunnel under the railway and Depot Avenue; Fern Lane; driveways."""
    lane = two_way(3.4, lanes="2", maxspeed="30 mph")
    under = two_way(3.6, lanes="2", maxspeed="30 mph", tunnel="yes", layer="-1", lit="yes", width="8.4")
    drive = two_way(0, 0, 0, centre_m=4.0, service="driveway")
    gravel = {"highway": "service", "surface": "gravel", "trafficway": 0}
    paved = {"highway": "service", "trafficway": 0}
    return [
        Road.along("elder", [(260, -760), (260, 462)], [((260, -480), lane), ((260, -380), under), (None, lane)],
                   name="Elder Street", highway="tertiary", reported_as="ELDER ST", **_SURFACE),
        Road.along("depot", [(-420, -430), (560, -430)], [(None, two_way(3.4, lanes="2", maxspeed="35 mph"))],
                   name="Depot Avenue", highway="unclassified", reported_as="DEPOT AVE", **_SURFACE),
        Road.along("fern", [(650, 0), (650, 240)], [(None, two_way(3.3, lanes="2", maxspeed="25 mph"))],
                   name="Fern Lane", highway="residential", reported_as="FERN LN", **_SURFACE),
        Road.along("drive_diner", [(480, 0), (480, -60)], [(None, drive)], **paved),
        Road.along("drive_market", [(860, 0), (860, 80)], [(None, drive)], **paved),
        Road.along("drive_dogwood", [(130, -60), (158, -60)], [(None, drive)], **gravel),
        Road.along("drive_alder", [(-260, -195), (-232, -195)], [(None, drive)], **gravel),
        Road.along("garnet", [(-260, -195), (-335, -195)], [(None, two_way(3.3, maxspeed="25 mph"))],
                   name="Garnet Court", highway="residential", reported_as="GARNET CT", **_SURFACE),
    ]  # fmt: skip


def _parkway() -> list[Road]:
    """Meridian Parkway, divided: signals at Main Street, stop signs at Sedge Road, bridges over the freeway."""
    two = one_way(3.6, 2, lanes="2", maxspeed="50 mph")
    over = one_way(3.6, 2, lanes="2", maxspeed="50 mph", bridge="yes", layer="1")
    # The way goes on straight where the pocket opens on its left: it then lies right of lane 2.
    pocket = one_way(
        3.6, 3, way_left_m=-1.8, lanes="3", maxspeed="50 mph", turn__lanes="left|through|through;right",
        placement="right_of:2",
    )  # fmt: skip
    parkway = {
        "highway": "primary", "name": "Meridian Parkway", "ref": "US 583", "reported_as": "MERIDIAN PKWY",
        "trafficway": 2, **_SURFACE,
    }  # fmt: skip
    end = two_way(3.6, lanes="2", maxspeed="55 mph")
    rural = {"highway": "primary", "name": "Meridian Road", "ref": "US 583", "reported_as": "US-583", **_SURFACE}
    return [
        Road.along("meridian_north", [(1000, -760), (1009, -690), (1009, 1090), (1000, 1160)],
                   [((1009, -80), two), ((1009, 0), pocket), ((1009, 765), two), ((1009, 835), over), (None, two)],
                   radii={1: 250.0, 2: 250.0}, **parkway),
        Road.along("meridian_south", [(1000, 1160), (991, 1090), (991, -690), (1000, -760)],
                   [((991, 835), two), ((991, 765), over), ((991, 80), two), ((991, 0), pocket), (None, two)],
                   radii={1: 250.0, 2: 250.0}, **parkway),
        Road.along("meridian_road_south", [(1000, -1060), (1000, -760)], [(None, end)], **rural),
        Road.along("meridian_road_north", [(1000, 1160), (1000, 1460)], [(None, end)], **rural),
        Road.along("sedge", [(700, -400), (1300, -400)], [(None, two_way(3.4, lanes="2", maxspeed="35 mph"))],
                   name="Sedge Road", highway="unclassified", reported_as="SEDGE RD", **_SURFACE),
    ]  # fmt: skip


def _freeway() -> list[Road]:
    """I-780, two carriageways, and its interchange with the parkway."""
    two = one_way(3.65, 2, lanes="2", maxspeed="75 mph")
    joining = one_way(3.65, 3, way_left_m=1.825, lanes="3", maxspeed="75 mph",
                      turn__lanes="none|none|merge_to_left", placement="right_of:1")  # fmt: skip
    leaving = one_way(3.65, 3, way_left_m=1.825, lanes="3", maxspeed="75 mph",
                      turn__lanes="through|through|slight_right", placement="right_of:1")  # fmt: skip
    ramp = one_way(4.5, lanes="1", maxspeed="45 mph")
    motorway = {"highway": "motorway", "ref": "I 780", "name": "Sandhill Freeway", "reported_as": "I-780",
                "trafficway": 3, "surface": "concrete"}  # fmt: skip
    link = {"highway": "motorway_link", "trafficway": 6, "reported_as": "I-780 RAMP", **_SURFACE}
    crossover = {"highway": "primary_link", **_SURFACE}
    return [
        Road.along("freeway_east", [(-1700, 789), (2000, 789)],
                   [((430, 789), two), ((580, 789), leaving), ((1420, 789), two), ((1640, 789), joining), (None, two)],
                   **motorway),
        Road.along("freeway_west", [(2000, 811), (-1700, 811)],
                   [((1570, 811), two), ((1420, 811), leaving), ((580, 811), two), ((360, 811), joining), (None, two)],
                   **motorway),
        Road.along("ramp_east_off", [(580, 789), (690, 776), (900, 700), (991, 690)], [(None, ramp)],
                   radii={1: 300.0, 2: 120.0}, destination__ref="US 583", **link),
        Road.along("ramp_east_on", [(1009, 690), (1100, 700), (1310, 776), (1420, 789)], [(None, ramp)],
                   radii={1: 120.0, 2: 300.0}, **link),
        Road.along("ramp_west_off", [(1420, 811), (1310, 824), (1100, 900), (1009, 910)], [(None, ramp)],
                   radii={1: 300.0, 2: 120.0}, destination__ref="US 583", **link),
        Road.along("ramp_west_on", [(991, 910), (900, 900), (690, 824), (580, 811)], [(None, ramp)],
                   radii={1: 120.0, 2: 300.0}, **link),
        Road.along("crossover_south", [(991, 690), (1009, 690)], [(None, two_way(3.6, lanes="2"))], **crossover),
        Road.along("crossover_north", [(991, 910), (1009, 910)], [(None, two_way(3.6, lanes="2"))], **crossover),
    ]  # fmt: skip


def draw(all_roads: dict[str, Road]) -> OsmFile:
    """The town as an OSM file."""
    osm = OsmFile()
    for road in all_roads.values():
        osm.add_road(road)
    _cross(osm)
    _sign(osm)
    _furnish(osm)
    osm.finish_roads()
    return osm


def _cross(osm: OsmFile) -> None:
    signals = {"highway": "traffic_signals", "traffic_signals": "signal"}
    osm.join(-330, 0, "main_west", "main")
    osm.join(330, 0, "main", "main_east")
    osm.join(-1000, 0, "main_west", "old_mill")
    osm.join(-700, 0, "main_west", "harrow")
    osm.join(-520, 0, "main_west", "cottonwood")
    osm.join(-520, -260, "tallow", "cottonwood")
    osm.join(-260, 0, "main", "alder")
    birch = osm.join(-130, 0, "main", "birch", **signals)
    osm.join(0, 0, "main", "cedar", **signals)
    osm.join(130, 0, "main", "dogwood")
    osm.join(260, 0, "main", "elder", **signals)
    for u, street in ((-260, "alder"), (-130, "birch"), (0, "cedar"), (130, "dogwood"), (260, "elder")):
        osm.join(u, -260, "tallow", street)
        osm.join(u, -130, "sumner", street)
        osm.join(u, 130, "quarry", street)
        osm.join(u, 260, "prospect", street, *(["beacon"] if street == "alder" else []))
    osm.join(-420, 260, "prospect", "north_mill")
    mill = osm.join(-405, 260, "prospect", "south_mill")
    osm.join(560, 260, "prospect", "gable")
    osm.join(560, 130, "quarry", "gable")
    osm.join(560, 480, "linden_east", "gable")
    osm.join(-260, 480, "alder", "linden_west")
    osm.join(-260, -430, "alder", "depot")
    osm.join(260, 462, "elder", "ring")
    osm.join(260, 498, "elder_north", "ring")
    a, b = 16.9145, 6.1564
    for u, side in ((204, "linden_west"), (316, "linden_east")):
        osm.join(u, 480, side, f"{side}_in", f"{side}_out")
    osm.join(260 - a, 480 - b, "linden_west_in", "ring")
    osm.join(260 - a, 480 + b, "linden_west_out", "ring")
    osm.join(260 + a, 480 + b, "linden_east_in", "ring")
    osm.join(260 + a, 480 - b, "linden_east_out", "ring")
    osm.join(650, 0, "main_east", "fern")
    osm.join(480, 0, "main_east", "drive_diner")
    osm.join(860, 0, "main_east", "drive_market")
    osm.join(130, -60, "dogwood", "drive_dogwood")
    osm.join(-260, -195, "alder", "drive_alder", "garnet")
    parkway_south = osm.join(991, 0, "main_east", "meridian_south")
    osm.join(1009, 0, "main_east", "meridian_north")
    osm.join(991, -400, "sedge", "meridian_south")
    osm.join(1009, -400, "sedge", "meridian_north")
    osm.join(1000, -760, "meridian_north", "meridian_south", "meridian_road_south")
    osm.join(1000, 1160, "meridian_north", "meridian_south", "meridian_road_north")
    osm.join(580, 789, "freeway_east", "ramp_east_off", highway="motorway_junction", ref="112")
    osm.join(1420, 789, "freeway_east", "ramp_east_on")
    osm.join(1420, 811, "freeway_west", "ramp_west_off", highway="motorway_junction", ref="112")
    osm.join(580, 811, "freeway_west", "ramp_west_on")
    osm.join(991, 690, "ramp_east_off", "crossover_south", "meridian_south")
    osm.join(1009, 690, "ramp_east_on", "crossover_south", "meridian_north")
    osm.join(1009, 910, "ramp_west_off", "crossover_north", "meridian_north")
    osm.join(991, 910, "ramp_west_on", "crossover_north", "meridian_south")
    osm.restrict("no_left_turn", birch, ("main", 1), ("birch", 1))
    osm.restrict("no_u_turn", parkway_south, ("meridian_south", 1), ("meridian_south", 1))
    osm.restrict("no_right_turn", mill, ("prospect", 1), ("south_mill", 1))


def _sign(osm: OsmFile) -> None:
    """Signals at stop lines, stop and give-way signs; ``direction`` is relative to the way, as mappers tag it."""
    for road, v in (("meridian_north", -12), ("meridian_south", 12)):
        osm.mark(road, 1009 if road == "meridian_north" else 991, v, highway="traffic_signals",
                 traffic_signals="signal", traffic_signals__direction="forward")  # fmt: skip
    for u, direction in ((974, "forward"), (1026, "backward")):
        osm.mark("main_east", u, 0, highway="traffic_signals", traffic_signals="signal",
                 traffic_signals__direction=direction)  # fmt: skip
    stops = [
        ("harrow", -700, 9, "backward"), ("old_mill", -1014, -7.4, "backward"), ("cottonwood", -520, -9, "forward"),
        ("alder", -260, -12, "forward"), ("alder", -260, 12, "backward"), ("dogwood", 130, -12, "forward"),
        ("dogwood", 130, 12, "backward"), ("fern", 650, 13, "backward"), ("south_mill", -405, 251, "backward"),
        ("north_mill", -420, 269, "backward"), ("gable", 560, 251, "forward"), ("gable", 560, 269, "backward"),
        ("garnet", -269, -195, "backward"),
        ("sumner", 121, -130, "forward"), ("sumner", 139, -130, "backward"), ("alder", -260, 251, "forward"),
        ("alder", -260, 270, "backward"), ("beacon", -268, 268, "backward"), ("sedge", 981, -400, "forward"),
        ("sedge", 1019, -400, "backward"), ("quarry", -139, 130, "forward"), ("quarry", -121, 130, "backward"),
        ("ramp_east_off", 979, 691, "forward"), ("ramp_west_off", 1021, 909, "forward"),
    ]  # fmt: skip
    for road, u, v, direction in stops:
        osm.mark(road, u, v, highway="stop", direction=direction)
    for road, u, v, direction in (
        ("elder", 260, 453, "forward"), ("elder_north", 260, 507, "backward"),
        ("linden_west_in", 233, 475.4, "forward"), ("linden_east_in", 287, 484.6, "forward"),
    ):  # fmt: skip
        osm.mark(road, u, v, highway="give_way", direction=direction)
    osm.mark("main", -130 + 9, 0, highway="crossing", crossing="traffic_signals")
    osm.mark("main", 100, 0, highway="crossing", crossing="uncontrolled")


def _furnish(osm: OsmFile) -> None:
    """What a real extract is full of and a road map has no use for."""
    for i, (u, v) in enumerate((u, v) for u in (-195, -65, 65, 195) for v in (-195, -65, 65, 195)):
        for du, dv in ((-35, -35), (12, -35), (-35, 12), (12, 12)):
            west, south, east, north = u + du, v + dv, u + du + 24, v + dv + 20 - i % 5
            address = {"addr__housenumber": str(100 + 2 * i)} if du < 0 else {}
            osm.area([(west, south), (east, south), (east, north), (west, north)], building="yes", **address)
    for side in (-9.5, 9.5):
        osm.line([(-318, side), (318, side)], highway="footway", footway="sidewalk", surface="concrete")
    osm.line([(-900, -405), (900, -405)], railway="rail", gauge="1435", usage="branch")
    osm.line([(200, 300), (240, 420), (250, 456)], highway="path", surface="dirt")
    osm.area([(440, -60), (520, -60), (520, -20), (440, -20)], amenity="parking", surface="asphalt")
    osm.area([(300, 520), (520, 520), (520, 660), (300, 660)], leisure="park", name="Whistler Park")
    osm.line([(-900, 640), (-700, 640), (-500, 700), (100, 690)], waterway="stream", name="Coldwater Creek")
    osm.line([(340, -300), (340, 120)], power="minor_line")
