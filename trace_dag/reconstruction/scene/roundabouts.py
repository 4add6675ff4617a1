"""Roundabouts of a network: a short closed chain of one-way lanes that always turns left.

It turns right if traffic keeps left."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork

LONGEST_M = 240.0  # an outer radius of 38 m: FHWA gives 20 to 30 m for one lane, 25 to 40 m for two
_OUTWARD_RAD = math.radians(-15)  # a lane that turns away from the middle by more than this leaves the ring
_OUT_OF_ROUND = 1.7  # farthest over nearest distance from the middle; a pair of median crossovers is far longer


def ring_through(
    network: RoadNetwork, seed: LaneRef, centreline: Callable[[LaneRef], FloatArray]
) -> tuple[LaneRef, ...]:
    """Return the lanes of the roundabout of ``seed``, in the direction of travel from it; empty without one.

    ``centreline`` returns a lane's centre, shape (n, 4), as :meth:`RoadNetwork.centreline`.

    >>> lane = network.drivable_lanes()[0]
    >>> ring_through(network, lane, network.centreline)  # this town has crossings, and no roundabout
    ()
    """
    if not _in_ring(network, seed, centreline):
        return ()
    lengths = {seed: _length(centreline(seed))}
    queue: list[tuple[float, tuple[LaneRef, ...]]] = [(lengths[seed], (seed,))]
    best: dict[LaneRef, float] = {}
    while queue:
        driven, lanes = heapq.heappop(queue)
        for ref in network.successors(lanes[-1]):
            if ref == seed:
                return lanes if _round(lanes, centreline) else ()
            if not _in_ring(network, ref, centreline):
                continue
            length = driven + _length(centreline(ref))
            if length <= LONGEST_M and length < best.get(ref, math.inf):
                best[ref] = length
                heapq.heappush(queue, (length, (*lanes, ref)))
    return ()


def _in_ring(network: RoadNetwork, ref: LaneRef, centreline: Callable[[LaneRef], FloatArray]) -> bool:
    section = network.road_by_id[ref.road_id].lane_sections[ref.section]
    one_way = all(lane.id * ref.lane_id > 0 for lane in section.lanes if lane.id != 0 and lane.type.drivable)
    heading = centreline(ref)[:, 3]
    inwards = -1.0 if network.road_by_id[ref.road_id].left_hand else 1.0
    return one_way and inwards * float(heading[-1] - heading[0]) > _OUTWARD_RAD


def _round(lanes: tuple[LaneRef, ...], centreline: Callable[[LaneRef], FloatArray]) -> bool:
    points = np.concatenate([centreline(ref)[:, :2] for ref in lanes])
    turned = math.fsum(float(np.diff(centreline(ref)[:, 3]).sum()) for ref in lanes)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.hypot(*(points - middle).T)
    return abs(turned) > math.radians(270) and float(radius.max()) <= _OUT_OF_ROUND * float(radius.min())


def _length(centre: FloatArray) -> float:
    return float(np.hypot(np.diff(centre[:, 0]), np.diff(centre[:, 1])).sum())
