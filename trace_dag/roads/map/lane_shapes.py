"""Lanes of a map as polylines, with the lanes before, after and beside each, as most tools read them.

OpenDRIVE describes lanes by offsets from a reference line; CommonRoad, MetaDrive, SUMO and graphs of lanes need points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.network import RoadNetwork


@dataclass(frozen=True, eq=False)
class LaneShape:
    """A lane in its direction of travel: centre and borders, each of shape (n, 3), x, y, z (m, local frame), one n.

    Points are at most :data:`~trace_dag.roads.map.lane_geometry.LANE_STEP_M` apart along the reference line.

    ``left`` and ``right`` are the adjacent drivable lanes of either direction; ``left_same_way`` and ``right_same_way``
    tell whether their direction is the same. ``successors`` and ``predecessors`` are in the direction of travel,
    several at a junction; a lane without traffic has neither these nor neighbours. ``speed_mps`` is the limit, or None.
    """

    ref: LaneRef
    type: LaneType
    centre_m: FloatArray
    left_m: FloatArray
    right_m: FloatArray
    predecessors: tuple[LaneRef, ...]
    successors: tuple[LaneRef, ...]
    left: LaneRef | None
    right: LaneRef | None
    left_same_way: bool
    right_same_way: bool
    speed_mps: float | None
    junction_id: str | None

    @property
    def length_m(self) -> float:
        """Return the length of the centre, seen from above."""
        return float(np.hypot(*np.diff(self.centre_m[:, :2], axis=0).T).sum())


def lane_shapes(network: RoadNetwork, *, drivable_only: bool = False) -> tuple[LaneShape, ...]:
    """Return the lanes of a map, in its order; with ``drivable_only`` only those for traffic."""
    refs = network.drivable_lanes() if drivable_only else network.lanes()
    return tuple(_shape(network, ref) for ref in refs)


def _shape(network: RoadNetwork, ref: LaneRef) -> LaneShape:
    lane, road, geometry = network.lane(ref), network.road_by_id[ref.road_id], network.geometry(ref)
    centre = geometry.samples.centre_m
    left, right = geometry.borders()
    beside = network.neighbours(ref) if lane.type.drivable else (None, None)
    same_way = [each is not None and (each.lane_id > 0) == (ref.lane_id > 0) for each in beside]
    return LaneShape(
        ref=ref,
        type=lane.type,
        centre_m=centre if geometry.direction > 0 else centre[::-1],
        left_m=left,
        right_m=right,
        predecessors=network.predecessors(ref),
        successors=network.successors(ref),
        left=beside[0],
        right=beside[1],
        left_same_way=same_way[0],
        right_same_way=same_way[1],
        speed_mps=lane.speed_mps or road.speed_mps,
        junction_id=road.junction_id,
    )
