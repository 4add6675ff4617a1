"""Small maps and reports for the tests of placing crashes: streets as lines of metres around the reported point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from lxml import etree

from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import RoadSettings
from trace_dag.common.units import mph_to_mps
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.crash.record import CrashRecord, VehicleClass, VehicleRecord
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay
from trace_dag.roads.build import PlainMap, build_plain_map
from trace_dag.roads.crash_site.crossings import add_kinds
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.map.network import RoadNetwork

FRAME = LocalFrame(37.0, -77.0)
SETTINGS = RoadSettings()
Points = Sequence[tuple[float, float]]


class Town:
    """An extract made of streets. Streets that share a point share its node, unless they are on different ``level``."""

    def __init__(self) -> None:
        self._ids = count(1)
        self._nodes: dict[tuple[float, float, str], OsmNode] = {}
        self._ways: list[OsmWay] = []
        self._walkways: list[OsmWay] = []
        self._relations: list[OsmRelation] = []

    def street(self, points: Points, *, highway: str = "residential", level: str = "", **tags: str) -> int:
        """A way through points in metres; ``__`` in a key stands for a colon. Returns its id."""
        refs = tuple(self._node(x, y, level).id for x, y in points)
        named = {key.replace("__", ":"): value for key, value in tags.items()}
        self._ways.append(OsmWay(len(self._ways) + 1, refs, {"highway": highway, **named}))
        return self._ways[-1].id

    def walkway(self, points: Points, **tags: str) -> int:
        """A footway that is a way of its own: ``footway="sidewalk"`` or ``"crossing"``. Returns its id."""
        refs = tuple(self._node(x, y, "").id for x, y in points)
        self._walkways.append(OsmWay(1001 + len(self._walkways), refs, {"highway": "footway", **tags}))
        return self._walkways[-1].id

    def sign(self, x_m: float, y_m: float, **tags: str) -> int:
        """Tags on the node at a place."""
        node = self._node(x_m, y_m, "")
        self._nodes[float(x_m), float(y_m), ""] = node._replace(tags={**node.tags, **tags})
        return node.id

    def restriction(self, origin: int, via: tuple[float, float], target: int, **tags: str) -> None:
        """A turn restriction from way to way at a node."""
        node = self._node(*via, "")
        members = (OsmMember("way", origin, "from"), OsmMember("node", node.id, "via"), OsmMember("way", target, "to"))
        named = {key.replace("__", ":"): value for key, value in tags.items()}
        self._relations.append(OsmRelation(len(self._relations) + 1, members, {"type": "restriction", **named}))

    def extract(self) -> OsmExtract:
        """What the converter takes."""
        nodes = {node.id: node for node in self._nodes.values()}
        box = BoundingBox(36.99, -77.01, 37.01, -76.99)
        return OsmExtract(box, nodes, tuple(self._ways), tuple(self._relations), walkways=tuple(self._walkways))

    def network(self) -> RoadNetwork:
        """What the converter makes of it."""
        extract = along_traffic(self.extract())
        return add_kinds(convert(extract, FRAME, SETTINGS), extract)

    def made(self) -> PlainMap:
        """The map as ``trace-dag map`` makes it."""
        return build_plain_map(self.extract(), FRAME, SETTINGS, name="town", left_hand=False)

    def xodr(self) -> etree._Element:
        """The root of that map's file, read by lxml alone."""
        return etree.fromstring(self.made().stored.xodr)

    def _node(self, x_m: float, y_m: float, level: str) -> OsmNode:
        key = (float(x_m), float(y_m), level)
        if key not in self._nodes:
            latitude, longitude = FRAME.to_geographic([x_m, y_m]).tolist()  # type: ignore[arg-type]
            self._nodes[key] = OsmNode(next(self._ids), latitude, longitude)
        return self._nodes[key]


def straight_street(**tags: str) -> RoadNetwork:
    """200 m of a road along the x axis, its middle at the origin."""
    town = Town()
    town.street([(-100, 0), (100, 0)], **tags)
    return town.network()


def vehicle(
    number: int = 1,
    *,
    lanes: int | None = None,
    trafficway: int | None = None,
    control: int | None = None,
    limit_mph: float | None = None,
) -> VehicleRecord:
    """A car that says something of its road."""
    return VehicleRecord(
        number=number,
        vehicle_class=VehicleClass.CAR,
        length_m=4.7,
        width_m=1.85,
        height_m=1.5,
        mass_kg=1600.0,
        lanes=lanes,
        trafficway_code=trafficway,
        traffic_control_code=control,
        speed_limit_mps=None if limit_mph is None else mph_to_mps(limit_mph),
    )


def report(
    *vehicles: VehicleRecord,
    at_m: tuple[float, float] = (0.0, 0.0),
    street: str = "",
    cross: str = "",
    topology: RoadTopology = RoadTopology.NOT_AN_INTERSECTION,
    function_class: int | None = None,
    junction_relation: int | None = None,
) -> CrashRecord:
    """A crash at a point in metres."""
    latitude, longitude = FRAME.to_geographic(at_m).tolist()  # type: ignore[arg-type]
    return CrashRecord(
        key="2023-510001",
        case_year=2023,
        state_case=510001,
        latitude_deg=latitude,
        longitude_deg=longitude,
        vehicles=vehicles or (vehicle(1), vehicle(2)),
        events=(),
        collision_type=CollisionType.ANGLE,
        road_topology=topology,
        vehicle_trajectory=VehicleTrajectory.INTERSECTING,
        trafficway_1=street,
        trafficway_2=cross,
        function_class_code=function_class,
        junction_relation_code=junction_relation,
    )
