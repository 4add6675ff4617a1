"""Roads and their surroundings as surfaces: pavement by type, kerbs, paint, and the ground between.

Seen from above, surfaces do not overlap: overlapping lanes, as in junctions, become one surface. Heights are those of
the lanes nearest to a point; the ground reaches from road to road.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely
from scipy.spatial import cKDTree

from trace_dag.pages.map_ground import STROKE_M, SURFACES, WHITE, Arrows, Crosswalks, Marks, find_paved_gaps
from trace_dag.pages.map_scene import MapScene, SeenLane, SeenSection, Window
from trace_dag.pages.solid.gltf import Material
from trace_dag.pages.solid.shapes import Mesh, flat, join_shapes, prism, ribbons
from trace_dag.roads.map.lane_index import unite_areas
from trace_dag.roads.map.model import LaneType
from trace_dag.scenario.drawn_shapes import outline
from trace_dag.scenario.polylines import worth_keeping
from trace_dag.simulation.roadside_terrain import FORE_SLOPE_M

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.simulation.objects import FixedObject
    from trace_dag.simulation.roadside_terrain import RoadsideTerrain

KERB_M: Final = 0.15
"""Height of a kerb: AASHTO Green Book, 7th edition, section 4.7.1 (6 in)."""
_RAISED: Final = frozenset({LaneType.SIDEWALK, LaneType.MEDIAN})
_GRASS: Final = Material("#8FA36B", roughness=1.0)
_KERB: Final = Material("#B9B5AB")
_DECK: Final = Material("#8A8880")
_DECK_M: Final = 0.9  # thickness
_LIFTED_M: Final = 1.0  # a road that is higher than this above the ground is a bridge
_ABOVE_M: Final = 0.02  # paint above pavement
_STEP_M: Final = 1.0 / 256.0  # points are rounded to this: what repeats compresses
_WAY_M: Final = 2.5  # to each side of where a body went
_AT_EDGE_M: Final = 0.02  # of that
_FITS_M: Final = 1e-3  # all points together are this far off at most: rounding
_BORDER_M: Final = 4.0  # spacing of border points on slopes
_TURN_STROKE_M: Final = 0.18


class Heights:
    """Heights of a surface by known points, shape (n, 3): a mean of the nearest ones, weighted by nearness.

    0 without any. Along a ``way``, the points of bodies beside roads, it has the heights of these points; beside
    ``sides`` it has their slope.
    """

    def __init__(
        self, points_m: FloatArray, way_m: FloatArray | None = None, sides: RoadsideTerrain | None = None
    ) -> None:
        self._sides = sides
        self._z = points_m[:, 2]
        self._tree = cKDTree(points_m[:, :2]) if len(points_m) and np.ptp(self._z) > 0.005 else None
        self._level_m = float(self._z[0]) if len(points_m) else 0.0
        self._way = None if way_m is None or not len(way_m) else Heights(way_m)
        self._way_tree = None if self._way is None or way_m is None else cKDTree(way_m[:, :2])

    @property
    def level(self) -> bool:
        """Return whether every height is the same."""
        return self._tree is None and self._sides is None

    def at(self, places_m: FloatArray) -> FloatArray:
        """Return heights at some places, shape (n, 2)."""
        if self._sides is not None:
            fallen = [self._sides.at(x, y).height_m for x, y in places_m.tolist()]
            return np.asarray(self._of_roads(places_m) + np.array(fallen))
        return self._of_roads(places_m)

    def _of_roads(self, places_m: FloatArray) -> FloatArray:
        if self._tree is None:
            return np.full(len(places_m), self._level_m)
        away, nearest = self._tree.query(places_m, k=min(4, self._tree.n))
        weights = 1.0 / np.maximum(away, 1e-3) ** 2
        z = np.asarray((self._z[nearest] * weights).sum(axis=1) / weights.sum(axis=1))
        if self._way is not None and self._way_tree is not None:
            near = self._way_tree.query(places_m)[0] < _WAY_M + _AT_EDGE_M
            z[near] = self._way.at(places_m[near])
        return z

    def on(self, mesh: Mesh, above_m: float = 0.0) -> Mesh:
        """Return a flat shape laid on the surface."""
        return Mesh(np.column_stack([mesh.points_m[:, :2], self.at(mesh.points_m[:, :2]) + above_m]), mesh.triangles)


class Terrain:
    """The roads in a window (m) as surfaces, by material, and ``heights`` of the ground.

    ``areas`` are other parts of the ground, each with its material, the later above the earlier. ``ways``, each of
    shape (n, 3), m, are paths of bodies: beside roads the ground has their heights. ``sides`` returns the slopes beyond
    the edges of roads; it is used if it matches the heights of the bodies there better than level ground. The objects
    ``dug`` have their own ground.
    """

    def __init__(
        self,
        scene: MapScene,
        window: Window,
        areas: Sequence[tuple[Material, shapely.Geometry]] = (),
        ways: Sequence[FloatArray] = (),
        sides: Callable[[], RoadsideTerrain] | None = None,
        dug: Sequence[FixedObject] = (),
    ) -> None:
        self._dug = shapely.union_all([shapely.Polygon(outline(item)) for item in dug])
        self._window = window
        self._parts: dict[Material, list[Mesh]] = defaultdict(list)
        self._crossings = Crosswalks(scene)
        on_ground, lifted = _levels(scene)
        paved = [self._pave(scene, sections, Heights(_points(sections)), bridge=False) for sections in on_ground]
        decks = [(sections, Heights(_points(sections))) for sections in lifted]
        above = [(self._pave(scene, sections, heights, bridge=True), heights) for sections, heights in decks]
        everything = shapely.union_all([*paved, *(deck for deck, _ in above)])
        off_road, beside = _beside(ways, everything)
        points = np.concatenate([np.zeros((0, 3)), *map(_points, on_ground)])
        self.heights = Heights(points, off_road)
        off_m = _off_m(Heights(points), off_road)
        if sides is not None and off_m > _FITS_M:
            sloping = Heights(points, sides=sides())
            if _off_m(sloping, off_road) < off_m - _FITS_M:
                self.heights, beside = sloping, shapely.buffer(everything, FORE_SLOPE_M)
        if not self.heights.level:
            areas = [*areas, (_GRASS, beside)]
        self._lay_ground(shapely.union_all(paved), above, areas)

    @property
    def parts(self) -> list[tuple[Material, Mesh]]:
        """Return surfaces by material."""
        return by_material(self._parts)

    def _pave(
        self, scene: MapScene, sections: list[SeenSection], heights: Heights, *, bridge: bool
    ) -> shapely.Geometry:
        """Lay the surfaces of one level; return the area that they cover."""
        frame = shapely.box(*self._window)
        covered: shapely.Geometry = shapely.Polygon()
        for lane_type, area in _areas(scene, sections):
            area = _clean(shapely.difference(shapely.intersection(area, frame), covered))
            if not heights.level:
                area = shapely.segmentize(area, _BORDER_M)
            covered = _clean(shapely.union(covered, area))
            raised = KERB_M if lane_type in _RAISED else 0.0
            self._parts[Material(SURFACES[lane_type])].append(heights.on(flat(area), raised))
            if raised:
                self._parts[_KERB] += _walls(area, heights, 0.0, raised)
        if bridge:
            self._parts[_DECK] += _walls(covered, heights, -_DECK_M, 0.0)
            below = heights.on(flat(covered), -_DECK_M)
            self._parts[_DECK].append(Mesh(below.points_m, below.triangles[:, ::-1]))
        self._paint(sections, heights, covered)
        return covered

    def _paint(self, sections: list[SeenSection], heights: Heights, covered: shapely.Geometry) -> None:
        strokes = Marks(sections, legal=True).strokes(self._window)
        for colour, lines in strokes.items():
            self._parts[_paint(colour)].append(_strokes(lines, heights, STROKE_M))
        arrows = Arrows(sections).turns.seen(self._window)
        self._parts[_paint(WHITE)].append(_strokes(arrows, heights, _TURN_STROKE_M))
        shapely.prepare(covered)
        for number in self._crossings.bars.within(self._window):
            bar = shapely.Polygon(self._crossings.bars.points_m[number])
            if shapely.intersects(covered, bar):
                self._parts[_paint(WHITE)].append(heights.on(flat(bar), _ABOVE_M))

    def _lay_ground(
        self,
        paved: shapely.Geometry,
        decks: Sequence[tuple[shapely.Geometry, Heights]],
        areas: Sequence[tuple[Material, shapely.Geometry]],
    ) -> None:
        ground = _clean(shapely.difference(shapely.box(*self._window), shapely.union(paved, self._dug)))
        for deck, heights in decks:  # where a bridge begins the ground is no higher than its underside
            below = flat(_clean(shapely.intersection(ground, deck)))
            if len(below.triangles):
                z = np.minimum(self.heights.on(below).points_m[:, 2], heights.on(below, -_DECK_M).points_m[:, 2])
                self._parts[_GRASS].append(Mesh(np.column_stack([below.points_m[:, :2], z]), below.triangles))
                ground = _clean(shapely.difference(ground, deck))
        for material, area in reversed(areas):
            piece = _clean(shapely.intersection(area, ground))
            if not piece.is_empty:
                self._parts[material].append(self.heights.on(flat(piece)))
                ground = _clean(shapely.difference(ground, piece))
        self._parts[_GRASS].append(self.heights.on(flat(ground)))


def _levels(scene: MapScene) -> tuple[list[list[SeenSection]], list[list[SeenSection]]]:
    """Return the sections of each level on the ground, from below, and those of each level above it.

    A bridge of a map without heights counts as on the ground.
    """
    levels = scene.sections_by_layer()
    low = {level: list(sections) for level, sections in levels if level <= 0}
    known = Heights(np.concatenate([np.zeros((0, 3)), *map(_points, low.values())]))
    above: list[list[SeenSection]] = []
    for level, sections in levels:
        if level > 0:
            lifted = [each for each in sections if _rises(each, known)]
            low.setdefault(0, []).extend(each for each in sections if not _rises(each, known))
            above.append(lifted)
    return [sections for _, sections in sorted(low.items()) if sections], [sections for sections in above if sections]


def _rises(section: SeenSection, ground: Heights) -> bool:
    points = _points([section])
    return bool(len(points) and (points[:, 2] - ground.at(points[:, :2])).max() > _LIFTED_M)


def _points(sections: Iterable[SeenSection]) -> FloatArray:
    """Return the borders of the lanes of some sections, shape (n, 3)."""
    lines = [line for section in sections for lane in section.lanes for line in (lane.inner_m, lane.outer_m)]
    return np.concatenate([np.zeros((0, 3)), *lines])


def _beside(ways: Sequence[FloatArray], paved: shapely.Geometry) -> tuple[FloatArray, shapely.Geometry]:
    """Return the points of ways off the road, shape (n, 3), and the ground around these."""
    points = np.concatenate([np.zeros((0, 3)), *ways])
    shapely.prepare(paved)
    off_road = points[~shapely.intersects_xy(paved, points[:, 0], points[:, 1])]
    return off_road, shapely.union_all(shapely.buffer(shapely.points(off_road[:, :2]), _WAY_M, quad_segs=2))


def _off_m(heights: Heights, points_m: FloatArray) -> float:
    """Return the sum of the distances of points, shape (n, 3), from the ground."""
    return float(np.abs(heights.at(points_m[:, :2]) - points_m[:, 2]).sum())


def by_material(made: Mapping[Material, Sequence[Mesh]]) -> list[tuple[Material, Mesh]]:
    """Return one shape for each material in use, its points on a grid of 4 mm.

    >>> from trace_dag.pages.solid.shapes import box
    >>> post, none_of = Material("#7C8084"), Material("#C1272D")
    >>> [(material, mesh)] = by_material({post: [box((0, 0, 0), (1, 1, 1)), box((2, 0, 0), (3, 1, 1))], none_of: []})
    >>> material == post, float(mesh.points_m[:, 0].max())  # both boxes as one shape
    (True, 3.0)
    """
    shapes = [(material, join_shapes(meshes)) for material, meshes in made.items()]
    return [
        (material, Mesh(np.round(shape.points_m / _STEP_M) * _STEP_M, shape.triangles))
        for material, shape in shapes
        if len(shape.triangles)
    ]


def _paint(colour: str) -> Material:
    return Material(colour, roughness=0.8, layer=1)


def _strokes(lines: Sequence[FloatArray], heights: Heights, width_m: float) -> Mesh:
    """Return the painted lines, shape (n, 2) each, as strips.

    In bends their points are as dense as those of the lines.
    """
    painted = [line for line in lines if len(line) > 1]
    if not painted:
        return join_shapes([])
    points = np.concatenate(painted)
    raised = np.column_stack([points, heights.at(points) + _ABOVE_M])
    solid = np.split(raised, np.cumsum([len(line) for line in painted[:-1]]))
    kept = worth_keeping([[line] for line in solid], _STEP_M)
    return ribbons([line[numbers] for line, numbers in zip(solid, kept, strict=True)], width_m)


def _areas(scene: MapScene, sections: list[SeenSection]) -> Iterator[tuple[LaneType, shapely.Geometry]]:
    """Return the paved areas of one level by type of lane, uppermost first; traffic lanes are uppermost."""
    lanes: dict[LaneType, list[SeenLane]] = defaultdict(list)
    for section in sections:
        for lane in section.lanes:
            kind = lane.geometry.lane.type
            if kind is not LaneType.NONE:
                lanes[LaneType.DRIVING if SURFACES[kind] == SURFACES[LaneType.DRIVING] else kind].append(lane)
    driving = lanes[LaneType.DRIVING]
    if driving:
        yield (
            LaneType.DRIVING,
            unite_areas(map(shapely.Polygon, [*(lane.outline_m for lane in driving), *_gaps(driving)])),
        )
    for kind in sorted(lanes.keys() - {LaneType.DRIVING}, key=lambda kind: (kind in _RAISED, not kind.drivable, kind)):
        yield kind, unite_areas(shapely.Polygon(lane.outline_m) for lane in lanes[kind])


def _gaps(lanes: Sequence[SeenLane]) -> Iterator[FloatArray]:
    """Yield the pavement between the lanes of junctions."""
    inside = [lane for lane in lanes if lane.road.junction_id is not None]
    through: dict[str | None, list[int]] = defaultdict(list)
    for number, lane in enumerate(inside):
        through[lane.road.junction_id].append(number)
    for gap in find_paved_gaps([lane.outline_m for lane in inside], through.values()):
        yield gap.outline_m


def _clean(area: shapely.Geometry) -> shapely.MultiPolygon:
    """Return the polygons of a geometry, without slivers.

    It drops lines left between surfaces that meet in all but the last digit, because GEOS cannot always cut a
    collection of polygons and lines.
    """
    polygons = [part for part in shapely.get_parts(area) if isinstance(part, shapely.Polygon) and part.area > 0.02]
    return shapely.MultiPolygon(polygons)


def _walls(area: shapely.Geometry, heights: Heights, low_m: float, high_m: float) -> Iterator[Mesh]:
    """Yield the upright walls around an area, facing away from it."""
    for polygon in shapely.get_parts(area):
        for k, ring in enumerate((polygon.exterior, *polygon.interiors)):
            corners = shapely.get_coordinates(shapely.orient_polygons(shapely.Polygon(ring)))[:-1]
            z = heights.at(corners)
            wall = prism(corners, z + low_m, z + high_m)
            yield wall if k == 0 else Mesh(wall.points_m, wall.triangles[:, ::-1])
