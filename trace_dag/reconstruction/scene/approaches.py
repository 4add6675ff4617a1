"""An approach: one path of traffic past the crash.

It is a chain of lanes upstream and downstream of the crash, with the smooth path along it. Approaches are found by
:mod:`trace_dag.reconstruction.scene.approach_finder`. Frame: the local frame; distances in metres along the approach's
own path.

A roundabout is a short closed chain of one-way lanes that always turns left, or right if traffic keeps left.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import Path, through_points
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.crash_types import Turn
from trace_dag.roads.map.model import LaneRef, Road
from trace_dag.roads.map.network import RoadNetwork

WIDER_SMOOTHING_M = (4.5, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0, 32.0)
BEYOND_CRASH_M = 10.0  # nothing drives on past it
FITTED_LATERAL_MPS2 = 0.6 * GRAVITY_MPS2  # leaves room for the manoeuvre itself
HELD_LATERAL_MPS2 = 0.7 * GRAVITY_MPS2  # a little less than dry asphalt holds
BODY_WIDTH_M = 1.9
LEAST_ROOM_M = 0.4
LONGEST_M = 240.0  # an outer radius of 38 m: FHWA gives 20 to 30 m for one lane, 25 to 40 m for two
_OUTWARD_RAD = math.radians(-15)  # a lane that turns away from the middle by more than this leaves the ring
_OUT_OF_ROUND = 1.7  # farthest over nearest distance from the middle; a pair of median crossovers is far longer


@dataclass(frozen=True, eq=False)
class Approach:
    """One path past the crash.

    ``station_m`` is the station closest to the crash, and ``offset_m`` the distance of the crash to the left of the
    path there. ``turn`` is the turn that the lanes themselves make. In that case ``path`` runs straight on from
    ``turn_from_m``, where the turn's lanes begin, and ``exit_pose`` is their end. ``wrong_way``: against the lane's
    traffic. ``other_way``: against the mapped direction of a reversible road, whose traffic may have gone either way at
    that hour. ``extended``: continued straight on where the road ends. ``moves_out``: leaves the lane to pass, before
    the crash. ``share_of_ring``: the part of a roundabout driven before the crash. ``centre_lane``: the shared turn
    lane in the middle. Before ``mapped_from_m`` the map ends and the path is straight. ``beyond`` is the first lane
    past the crash and its junction. ``lane_from_left`` and ``lanes_along`` place the lane among those of its direction;
    ``lanes_total`` counts both.
    """

    name: str
    lanes: tuple[LaneRef, ...]
    path: Path
    station_m: float
    offset_m: float
    road: Road | None
    exit_road: Road | None = None
    turn: Turn | None = None
    turn_from_m: float = 0.0
    exit_pose: Pose | None = None
    wrong_way: bool = False
    other_way: bool = False
    centre_lane: bool = False
    centre_lane_beside: bool = False
    share_of_ring: float = 0.0
    extended: bool = False
    moves_out: bool = False
    mapped_from_m: float = 0.0
    lane_from_left: int = 0
    lanes_along: int = 1
    lanes_total: int = 2
    lane_turns: tuple[str, ...] = ()
    width_m: float = 3.5
    beyond: LaneRef | None = None
    _fitted: dict[float, Approach] = field(default_factory=dict, init=False, repr=False)

    def fitted(self, speed_mps: float) -> Approach:
        """Return the approach as driven at this speed.

        Bends that a map draws as kinks are rounded until they are drivable. The path stays within the lane if a car
        can; a sharper bend is cut as far as necessary.
        """
        reach_m = max(speed_mps, 1.0) * 7.0
        room_m = max((self.width_m - BODY_WIDTH_M) / 2, LEAST_ROOM_M)
        in_lane: Approach | None = None
        for sigma_m in (0.0, *WIDER_SMOOTHING_M):
            if sigma_m not in self._fitted:
                self._fitted[sigma_m] = self._smoothed(sigma_m) if sigma_m else self
            approach = self._fitted[sigma_m]
            path = approach.path
            driven = (path.s_m > approach.station_m - reach_m) & (path.s_m < approach.station_m + BEYOND_CRASH_M)
            lateral_mps2 = float(np.abs(path.curvature_1pm[driven]).max(initial=0.0)) * speed_mps**2
            if lateral_mps2 <= HELD_LATERAL_MPS2 and self._moved_m(path, driven) <= room_m:
                in_lane = approach
            if lateral_mps2 <= FITTED_LATERAL_MPS2:
                break
        return in_lane or approach

    def _moved_m(self, path: Path, driven: NDArray[np.bool_]) -> float:
        """Return the largest distance of a smoothed path from this approach's own where it is driven (metres)."""
        if path is self.path or not driven.any():
            return 0.0
        every = slice(None, None, 4)  # 2 m
        x, y = path.x_m[driven][every, None], path.y_m[driven][every, None]
        return float(np.sqrt(((x - self.path.x_m) ** 2 + (y - self.path.y_m) ** 2).min(axis=1)).max())

    def _smoothed(self, sigma_m: float) -> Approach:
        xyz_m = np.column_stack([self.path.x_m, self.path.y_m, self.path.z_m])
        path = through_points(xyz_m, sigma_m=sigma_m)
        here = self.path.pose(self.station_m)
        station, _ = path.project(here.x_m, here.y_m, near_s_m=self.station_m)
        turns = self.path.pose(self.turn_from_m)
        turn_from, _ = path.project(turns.x_m, turns.y_m, near_s_m=self.turn_from_m)
        return replace(self, path=path, station_m=station, turn_from_m=turn_from)

    @property
    def heading_rad(self) -> float:
        """Return the direction of travel before the crash (before the turn, if the lanes turn)."""
        at = self.turn_from_m if self.turn is not None else self.station_m
        return self.path.pose(max(at - 10.0, 0.0)).heading_rad

    @property
    def side(self) -> int:
        """Return the compass octant of its direction, 0 for east, counter-clockwise.

        Approaches of one side differ only in their lanes.
        """
        return round(self.heading_rad / (math.pi / 4)) % 8

    @property
    def course_rad(self) -> float:
        """Return the direction of travel at the crash."""
        return self.path.pose(self.station_m).heading_rad

    @property
    def kerb_sign(self) -> float:
        """Return the side of the road's edge seen from its lanes: -1 right, 1 left (in left-hand traffic)."""
        return 1.0 if self.road is not None and self.road.left_hand else -1.0

    @property
    def turn_across(self) -> Turn:
        """Return the turn across oncoming traffic: left, or right in left-hand traffic."""
        return Turn.LEFT if self.kerb_sign < 0 else Turn.RIGHT

    @property
    def lane_from_centre(self) -> int:
        """Return the number of lanes of its direction between this lane and the centre of the road."""
        return self.lane_from_left if self.kerb_sign < 0 else self.lanes_along - 1 - self.lane_from_left

    @property
    def goes_either_way(self) -> bool:
        """Return whether its one-way traffic may have gone either way at the hour of the crash."""
        return self.road is not None and self.road.reversible == "unknown"

    @property
    def one_way(self) -> bool:
        """Return whether the roadway carries only this direction: a one-way street or half of a divided one."""
        return self.lanes_total == self.lanes_along

    @property
    def curve_rad(self) -> float:
        """Return the heading change from 60 m before the crash to 20 m beyond, positive to the left."""
        s = np.array([self.station_m - 60.0, self.station_m + 20.0])
        heading = self.path.at(s)[3]
        return float(heading[1] - heading[0])


# --- roundabouts -----------------------------------------------------------------------------------------------------
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
