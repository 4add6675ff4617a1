"""OpenStreetMap features beside the road at the crash that a vehicle can strike: trees, poles, barriers and buildings.

They include only objects that a report can name as fixed objects. Areas farther off (water, woods, parking) are only
drawn in pictures.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
import shapely

from trace_dag.common.geometry import LocalFrame
from trace_dag.osm.types import OsmFeature
from trace_dag.roads.report import CrashPlacement, MappedThing

_REACH_M: Final = 40.0  # a vehicle that leaves the road stays within the clear zone
_KEYS: Final = ("barrier", "natural", "power", "highway", "man_made", "emergency", "amenity", "waterway", "building")
_ANY_VALUE: Final = ("traffic_sign", "bridge:support", "building")
_WITHOUT_WALLS: Final = frozenset(
    {"roof", "carport", "canopy", "no"}
)  # one drives below these: OSM's values of building
_BACKGROUND: Final = frozenset(
    {"grassland", "scrub", "water", "wetland", "wood", "river", "riverbank", "parking", "bridge"}
)


def things_near(
    features: Iterable[OsmFeature], frame: LocalFrame, placement: CrashPlacement
) -> tuple[MappedThing, ...]:
    """Return things within 40 m of the crash, nearest first, in the local frame.

    >>> things = things_near(extract.surroundings, network.frame, map_report.placement)
    >>> [thing.tag for thing in things][:3], len(things) == len(map_report.things)
    (['building'], True)
    """
    place = shapely.Point(placement.x_m, placement.y_m)
    found: list[tuple[float, MappedThing]] = []
    for each in features:
        tag = _tag(each)
        if tag is None:
            continue
        for part in shapely.get_parts(each.geometry):
            outline = part.exterior if part.geom_type == "Polygon" else part
            longitude_deg, latitude_deg = np.array(outline.coords).T
            xy_m = frame.to_local(latitude_deg, longitude_deg)
            shape = shapely.Point(xy_m[0]) if len(xy_m) == 1 else shapely.LineString(xy_m)
            distance_m = float(shape.distance(place))
            if distance_m <= _REACH_M:
                corners = tuple((round(float(x), 3), round(float(y), 3)) for x, y in xy_m)
                found.append((distance_m, MappedThing(each.id, tag, corners)))
    found.sort(key=lambda pair: (pair[0], pair[1].osm_id))
    return tuple(thing for _, thing in found)


def _tag(feature: OsmFeature) -> str | None:
    """Return the tag that names the type of a feature, as "natural=tree"; only the key if any value will do."""
    for key in _ANY_VALUE:
        if feature.tags.get(key, "no") not in _WITHOUT_WALLS:
            return key
    return next(
        (f"{key}={feature.tags[key]}" for key in _KEYS if key in feature.tags and feature.tags[key] not in _BACKGROUND),
        None,
    )
