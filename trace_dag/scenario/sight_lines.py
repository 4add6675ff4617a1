"""Lines of sight: the time from which each of two parties could see the other before they met.

Lines go from the driver's eye to the corners and the middle of the other's body; the other is visible while one of them
is free. An obstacle hides the part of a line that is below its top (2.5 D). The ground between is assumed level, and
the view in that direction and through the own vehicle as free. Obstacles are buildings, walls and hedges of
OpenStreetMap (without a height, with that of :mod:`trace_dag.scenario.opendrive_surroundings`: two storeys, 1.5 m),
fixed objects, and other vehicles and persons. Woods, fences, unreported traffic, and buildings that are relations are
no obstacles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from trace_dag.common.geometry import FloatArray, LocalFrame
from trace_dag.crash.parties import party_in_words, party_of_body
from trace_dag.scenario.drawn_shapes import outline
from trace_dag.scenario.opendrive_surroundings import local_shapes, told_height_m, usual_kind
from trace_dag.simulation.fronts import driver_eye_m
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, VehicleLog
from trace_dag.verdict.types import SightLine

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmFeature

_STEP_S: Final = 0.1
_SHARE_OF_S: Final = 5.0
_BESIDE_WAYS_M: Final = 3.0  # bodies are wider than their ways
_BELOW_TOP_M: Final = 0.25
"""Part of a vehicle that has to be seen: AASHTO, Green Book, 2018, section 3.2.6, has 1.08 m of a car of 1.33 m."""
_OPAQUE: Final = frozenset({"wall", "city_wall", "hedge"})  # of barrier; a retaining wall may be below the road
_OPEN_BELOW: Final = frozenset({"roof", "carport"})
_CORNERS: Final = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [0, 0]]) / 2

_Bools = npt.NDArray[np.bool_]


class _Hider(NamedTuple):
    """An obstacle: its shape, or one for each moment, shape (n, 1), and its height (m)."""

    name: str
    osm_id: str
    shape: npt.NDArray[np.object_]
    height_m: float


def sight_lines(log: SimulationLog, features: Sequence[OsmFeature], frame: LocalFrame) -> tuple[SightLine, ...]:
    """Return each party's view of the other in the first contact; animals have none.

    ``features`` are those beside the roads. The result is empty without a contact.

    >>> [round(each.hidden_share, 2) for each in sight_lines(log, [], network.frame)]  # nothing stands there
    [0.0, 0.0]
    """
    contact = log.first_contact
    if contact is None or contact.number_2 not in log.bodies:
        return ()
    times_s = log.vehicles[0].time_s
    wanted_s = np.arange(contact.time_s - _STEP_S, times_s[0], -_STEP_S)[::-1]
    steps = np.unique(np.append(0, np.searchsorted(times_s, wanted_s, side="right") - 1))
    met = (contact.number_1, contact.number_2)
    standing = [*_things(features, frame, _paths(log, met, steps)), *_objects(log)]
    moving = [
        _body(each, log.bodies[each.number], steps) for each in log.vehicles if party_of_body(each.number) not in met
    ]
    return tuple(
        _sight_line(log, pair, steps, [*standing, *moving], contact.time_s)
        for pair in (met, met[::-1])
        if log.bodies[pair[0]].kind is not BodyKind.ANIMAL
    )


def _sight_line(
    log: SimulationLog, pair: tuple[int, int], steps: npt.NDArray[np.int64], hiders: Sequence[_Hider], contact_s: float
) -> SightLine:
    driver, other = pair
    eyes = _eyes(log.vehicle_log(driver), log.bodies[driver], steps)[:, None]
    bodies = [each for each in log.vehicles if party_of_body(each.number) == other]
    points = np.concatenate([_points(each, log.bodies[each.number], steps) for each in bodies], axis=1)
    blocked = [_hides(each, eyes, points) for each in hiders]
    hidden = np.any(blocked, axis=0).all(axis=1) if blocked else np.zeros(len(steps), bool)
    times_s = log.vehicles[0].time_s[steps]
    last = float(times_s[hidden][-1]) if hidden.any() else None
    seen_for_s = contact_s - (float(times_s[0]) if last is None else min(last + _STEP_S, contact_s))
    late = times_s >= contact_s - _SHARE_OF_S
    runs = [[k for k, _ in run] for is_hidden, run in groupby(enumerate(hidden), key=lambda each: each[1]) if is_hidden]
    found = SightLine(
        driver,
        other,
        round(seen_for_s, 2),
        round(float(hidden[late].mean()), 3),
        tuple(
            (round(float(times_s[run[0]]), 2), round(min(float(times_s[run[-1]]) + _STEP_S, contact_s), 2))
            for run in runs
        ),
    )
    if last is None:
        return found
    longest = hiders[int(np.argmax([each[hidden].sum() for each in blocked]))]
    return replace(found, hidden_by=longest.name, osm_id=longest.osm_id)


def _hides(hider: _Hider, eyes: FloatArray, points: FloatArray) -> _Bools:
    """Return a mask of the lines that an obstacle hides; ends have shapes (n, 1, 3) and (n, m, 3)."""
    eye_m, point_m = np.broadcast_arrays(eyes[..., 2], points[..., 2])
    low_eye, low_point = eye_m < hider.height_m, point_m < hider.height_m
    with np.errstate(divide="ignore", invalid="ignore"):
        at_top = np.clip(np.nan_to_num((hider.height_m - eye_m) / (point_m - eye_m)), 0.0, 1.0)
    along = points[..., :2] - eyes[..., :2]
    ends = [
        eyes[..., :2] + each[..., None] * along
        for each in (np.where(low_eye, 0.0, at_top), np.where(low_point, 1.0, at_top))
    ]
    lines = shapely.linestrings(np.stack(ends, axis=-2))
    return np.asarray((low_eye | low_point) & shapely.intersects(lines, hider.shape))


def _things(features: Sequence[OsmFeature], frame: LocalFrame, paths: npt.NDArray[np.object_]) -> Iterator[_Hider]:
    """Yield obstacles between two paths, without buildings that contain a party: under a roof, or by a map error."""
    reach = shapely.MultiLineString(list(paths)).convex_hull.buffer(_BESIDE_WAYS_M)
    shapely.prepare(reach)
    for feature in features:
        tags = feature.tags
        is_building = "building" in tags and tags["building"] not in _OPEN_BELOW
        is_building &= tags.keys().isdisjoint(("min_height", "building:min_level"))
        if not is_building and tags.get("barrier") not in _OPAQUE:
            continue
        for shape in local_shapes(feature, frame):
            kind = usual_kind(feature, shape)
            if (
                kind is not None
                and reach.intersects(shape)
                and not (shape.area and shapely.intersects(shape, paths).any())
            ):
                height_m = told_height_m(feature)
                name = "building" if is_building else tags["barrier"].replace("_", " ")
                yield _Hider(name, feature.id, np.array([shape]), kind.height_m if height_m is None else height_m)


def _paths(log: SimulationLog, numbers: Sequence[int], steps: npt.NDArray[np.int64]) -> npt.NDArray[np.object_]:
    ways = [log.vehicle_log(number) for number in numbers]
    return np.array(
        shapely.linestrings([np.column_stack([each.x_m, each.y_m])[np.append(steps, steps[-1])] for each in ways])
    )


def _objects(log: SimulationLog) -> Iterator[_Hider]:
    for item in log.objects:
        yield _Hider(item.name, item.osm_id, np.array([shapely.Polygon(outline(item))]), item.height_m)


def _body(log: VehicleLog, body: Body, steps: npt.NDArray[np.int64]) -> _Hider:
    corners = _points(log, body, steps)[:, :4, :2]
    return _Hider(party_in_words(log.number), "", np.asarray(shapely.polygons(corners))[:, None], body.height_m)


def _points(log: VehicleLog, body: Body, steps: npt.NDArray[np.int64]) -> FloatArray:
    """Return the corners and the middle of a body at the height that must be visible, shape (n, 5, 3)."""
    return _in_frame(log, steps, _CORNERS * (body.length_m, body.width_m), max(body.height_m - _BELOW_TOP_M, 0.0))


def _eyes(log: VehicleLog, body: Body, steps: npt.NDArray[np.int64]) -> FloatArray:
    ahead_m, left_m, up_m = driver_eye_m(body)
    return _in_frame(log, steps, np.array([[ahead_m, left_m]]), up_m)[:, 0]


def _in_frame(log: VehicleLog, steps: npt.NDArray[np.int64], ahead_left_m: FloatArray, up_m: float) -> FloatArray:
    cos, sin = np.cos(log.heading_rad[steps, None]), np.sin(log.heading_rad[steps, None])
    ahead, left = ahead_left_m.T
    x, y = log.x_m[steps, None] + cos * ahead - sin * left, log.y_m[steps, None] + sin * ahead + cos * left
    return np.stack([x, y, np.full_like(x, up_m)], axis=-1)
