"""Usual shoulders of fast roads, which OpenStreetMap seldom maps.

OpenStreetMap has shoulders on hardly any road (5 of 198 maps have one). AASHTO places kerbs beside slow roads and
shoulders beside the others (:func:`trace_dag.osm.road_classes.is_high_speed`). So a road of 50 mph and more gets the
shoulders of its class: on the right of each direction, and on one-way carriageways also on the left. There are none
where OpenStreetMap excludes them or has something else there: a mapped shoulder or parking lane, a sidewalk, a cycle
lane. There are also none on bridges and in tunnels, whose width is unknown, and beside unpaved roads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

from trace_dag.osm.road_classes import is_high_speed, usual_shoulder_m
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.street_graph import Street
from trace_dag.roads.from_osm.street_roads import StreetRoads
from trace_dag.roads.from_osm.strips import Strip, Strips, append_strip
from trace_dag.roads.from_osm.tags import WayProfile
from trace_dag.roads.map.curves import PlanView
from trace_dag.roads.map.model import LaneType

_SAID: Final = ("shoulder", "sidewalk", "cycleway")  # "shoulder=no" and "sidewalk=both" say that there is none
_SAYS_NOTHING: Final = frozenset({"no", "none", "separate", "shoulder"})  # of a sidewalk or a cycle lane
_UNPAVED: Final = frozenset(
    {"unpaved", "gravel", "fine_gravel", "compacted", "dirt", "earth", "ground", "grass", "mud", "sand"}
)


def shoulders_along(
    extract: OsmExtract,
    streets: Sequence[Street],
    plans: Sequence[PlanView],
    built: Mapping[int, StreetRoads],
    others: Strips,
) -> Strips:
    """Return the shoulders along the streets with roads, ``built``, where none of the ``others`` lies.

    >>> shoulders_along(extract, street_graph.streets, plans, street_roads, {})  # the streets of a town have none
    {}
    """
    tags_of = {way.id: way.tags for way in extract.ways}
    shoulders: Strips = {}
    for index in built:
        for span in streets[index].spans:
            profile = span.profile
            if not _has_shoulders(profile):
                continue
            tags = tags_of.get(profile.way_id, {})
            if tags.get("surface") in _UNPAVED or _says_otherwise(tags):
                continue
            begin_m, end_m = (plans[index].vertex_s_m[k] for k in (span.first, span.last))
            for side in (-1, 1):
                if _is_taken(profile, side):
                    continue
                width_m = usual_shoulder_m(profile.highway, left=profile.oneway and side > 0)
                taken = [(s.begin_m, s.end_m) for s in others.get(index, ()) if s.side == side]
                for low_m, high_m in _between(begin_m, end_m, taken):
                    shoulder = Strip(LaneType.SHOULDER, side, low_m, high_m, width_m)
                    append_strip(shoulders.setdefault(index, []), shoulder)
    return shoulders


def _has_shoulders(profile: WayProfile) -> bool:
    limits = [each for each in (profile.speed_forward_mps, profile.speed_backward_mps) if each is not None]
    plain = not (profile.bridge or profile.tunnel or profile.roundabout or profile.inferred)
    return plain and is_high_speed(profile.highway, max(limits, default=None))


def _says_otherwise(tags: Mapping[str, str]) -> bool:
    """Return whether the tags of a road describe the ground beside it."""
    for key, value in tags.items():
        subject = key.partition(":")[0]
        if subject == "shoulder" or (subject in _SAID and value not in _SAYS_NOTHING):
            return True
    return False


def _is_taken(profile: WayProfile, side: int) -> bool:
    """Return whether the road has lanes other than drivable ones and medians on a side."""
    lanes = profile.section.left if side > 0 else profile.section.forward
    return any(not (lane.type.drivable or lane.type is LaneType.MEDIAN) for lane in lanes)


def _between(begin_m: float, end_m: float, taken: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the free parts of a stretch.

    >>> _between(0.0, 100.0, [(20.0, 30.0), (90.0, 120.0)])
    [(0.0, 20.0), (30.0, 90.0)]
    """
    cuts = [
        (begin_m, begin_m),
        *sorted((max(a, begin_m), min(b, end_m)) for a, b in taken if b > begin_m and a < end_m),
    ]
    return [(a, b) for (_, a), (b, _) in pairwise([*cuts, (end_m, end_m)]) if b > a]
