"""Finding the approaches past the crash in the road network.

Every hypothesis chooses from them: through traffic of each lane, the approaches of a junction with their turns, the
paths into and around a roundabout, and the shared middle lane in both directions. Frame: the local frame.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, arc_lengths
from trace_dag.common.paths import STEP_M, extended, through_points
from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Turn
from trace_dag.reconstruction.scene.approaches import Approach, ring_through
from trace_dag.roads.map.model import LaneRef, LaneType, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.paths import follow

SMOOTHING_M = 3.0  # standard deviation; moves an arc of 20 m radius by 0.2 m
RING_SMOOTHING_M = 1.5
NEAR_M = 15.0  # lanes this near to the crash can be part of it
AROUND_M = 60.0  # other carriageways and approaches are looked for within this
JUNCTION_REACH_M = 45.0  # how far from the crash a junction's connecting lanes are looked for
OFF_JUNCTION_M = 20.0
TURN_RAD = math.radians(30)
SLIGHT_TURN_RAD = math.radians(12)
U_TURN_RAD = math.radians(160)
BENEATH_M = 3.0  # lanes this much higher or lower are on another level
EXTENSION_M = 120.0
MERGE_M = 60.0  # a change of lanes takes 3 to 5 s, some 60 m on city streets


@dataclass(frozen=True, eq=False)
class _Chain:
    lanes: tuple[LaneRef, ...]
    points: FloatArray  # (n, 3)
    starts_m: tuple[float, ...]  # where each lane begins along the points


@dataclass(eq=False)
class ApproachFinder:
    """Finds the approaches past one place of one network; remembers lane centres between calls."""

    network: RoadNetwork
    x_m: float
    y_m: float
    z_m: float
    back_m: float
    ahead_m: float
    _centres: dict[LaneRef, FloatArray] = field(default_factory=dict)
    _turns: dict[LaneRef, Turn | None] = field(default_factory=dict)
    _angles: dict[LaneRef, float] = field(default_factory=dict)
    _rings: dict[LaneRef, tuple[LaneRef, ...]] = field(default_factory=dict)

    def approaches(self, junction_id: str | None) -> tuple[Approach, ...]:
        """Return every approach within reach, nearest first; the order depends on the map alone."""
        found: dict[str, Approach] = {}
        covered: set[LaneRef] = set()  # lanes of an approach that goes straight along them, or around a ring
        for seed in self._seeds(junction_id):
            if seed in covered:
                continue
            covered.update(self._ring(seed))
            for approach in self._approaches_of(seed):
                found.setdefault(approach.name, approach)
                if approach.goes_either_way and approach.turn is None and not approach.extended:
                    back = self._other_way(approach)
                    found.setdefault(back.name, back)
                if approach.turn is None and not approach.extended and not approach.centre_lane:
                    covered.update(ref for ref in approach.lanes if self._road(ref).junction_id is None)
        return tuple(sorted(found.values(), key=lambda approach: (round(abs(approach.offset_m), 3), approach.name)))

    def against(self, approach: Approach) -> Approach:
        """Return the approach in the wrong direction, with enough road behind it, from the road beyond the crash."""
        if approach.other_way:
            lanes = approach.lanes
            chain = self._chain(lanes[0], upstream_m=self.back_m, downstream_m=self.ahead_m, keep=lanes)
            return replace(self._approach(chain), name=f"{approach.name} the wrong way", wrong_way=True)
        chain = self._chain(approach.lanes[0], upstream_m=self.ahead_m, downstream_m=self.back_m, keep=approach.lanes)
        path = through_points(chain.points, sigma_m=SMOOTHING_M).reversed()
        path = extended(path, back_m=EXTENSION_M, ahead_m=EXTENSION_M)
        station, offset = path.project(self.x_m, self.y_m)
        return replace(
            approach,
            name=f"{approach.name} the wrong way",
            path=path,
            station_m=station,
            offset_m=offset,
            turn=None,
            exit_pose=None,
            wrong_way=True,
            mapped_from_m=EXTENSION_M,
            **self._position(approach.beyond or approach.lanes[0]),
        )

    def _other_way(self, approach: Approach) -> Approach:
        """Return the approach for hours when the traffic of its reversible road goes in the other direction."""
        back = self.against(approach)
        return replace(
            back,
            name=f"{approach.name} the other way",
            wrong_way=False,
            other_way=True,
            lane_from_left=back.lanes_along - 1 - back.lane_from_left,
            lane_turns=(),
        )

    # --- finding lanes -----------------------------------------------------------------------------------------
    def _seeds(self, junction_id: str | None) -> list[LaneRef]:
        seeds: dict[LaneRef, None] = {}
        for match in self.network.nearest_lanes(self.x_m, self.y_m, AROUND_M, z_m=self.z_m):
            road = self.network.road_by_id[match.lane.road_id]
            near = match.outside_m <= NEAR_M
            if near or road.junction_id is None or road.junction_id == junction_id:
                seeds[match.lane] = None
        if junction_id is not None:
            junction = self.network.junction_by_id.get(junction_id)
            for connection in junction.connections if junction else ():
                road = self.network.road_by_id[connection.connecting_road]
                for index, section in enumerate(road.lane_sections):
                    for lane in section.lanes:
                        if lane.id != 0 and lane.type.drivable:
                            seeds[LaneRef(road.id, index, lane.id)] = None
        return [ref for ref in seeds if self._level(ref) and self._distance(ref) <= AROUND_M]

    def _level(self, ref: LaneRef) -> bool:
        centre = self._centre(ref)
        nearest = int(np.argmin(np.hypot(centre[:, 0] - self.x_m, centre[:, 1] - self.y_m)))
        return abs(float(centre[nearest, 2]) - self.z_m) <= BENEATH_M

    def _distance(self, ref: LaneRef) -> float:
        centre = self._centre(ref)
        return float(np.hypot(centre[:, 0] - self.x_m, centre[:, 1] - self.y_m).min())

    def _approaches_of(self, seed: LaneRef) -> list[Approach]:
        ring = self._ring(seed)
        if ring:
            return self._around(ring)
        if self._road(seed).junction_id is not None:
            return self._through_junction(seed) if self._distance(seed) <= JUNCTION_REACH_M else []
        if self.network.lane(seed).type is LaneType.BIDIRECTIONAL:
            return self._centre_lane(seed)
        straight_on = self._ends_near(seed) and not self._goes_straight(seed)
        approach = self._straight_on(seed) if straight_on else self._through(seed)
        return [approach] if approach is not None else []

    def _through_junction(self, seed: LaneRef) -> list[Approach]:
        """Return the movements of a connecting lane: through, a turn, or both for a slight turn."""
        turn = self._turn(seed)
        slight = self._slight_turn(seed)
        found = [self._through(seed)] if turn is None else [self._turning(seed, turn)]
        if slight is not None:
            found.append(self._turning(seed, slight))
        return [approach for approach in found if approach is not None]

    def _through(self, seed: LaneRef) -> Approach | None:
        """Return the straight path past the crash along the seed; None if its lanes turn there."""
        chain = self._chain(seed, upstream_m=self.back_m, downstream_m=self.ahead_m)
        for ref in chain.lanes:
            in_junction = self._road(ref).junction_id is not None
            if in_junction and self._distance(ref) <= JUNCTION_REACH_M and self._turn(ref) is not None:
                return None
        return self._approach(chain)

    def _centre_lane(self, seed: LaneRef) -> list[Approach]:
        """Return the shared lane in the middle, used in either direction."""
        chain = self._chain(seed, upstream_m=self.back_m, downstream_m=self.ahead_m)
        along = replace(self._approach(chain), centre_lane=True)
        back = self.against(along)
        return [along, replace(back, name=f"{along.name} against", wrong_way=False)]

    def _ring(self, seed: LaneRef) -> tuple[LaneRef, ...]:
        """Return the roundabout of a lane, or an empty tuple."""
        if seed not in self._rings:
            ring = ring_through(self.network, seed, self._centre) if self._distance(seed) <= AROUND_M else ()
            for ref in (seed, *ring):
                self._rings[ref] = ring
        return self._rings[seed]

    def _around(self, ring: tuple[LaneRef, ...]) -> list[Approach]:
        """Return one approach for each entry of a roundabout: the approach, then once around."""
        approaches = []
        for position, ref in enumerate(ring):
            for entry in self.network.predecessors(ref):
                if entry in ring or not (before := self.network.predecessors(entry)):
                    continue
                lane_before = self._chain(before[0], upstream_m=self.back_m, downstream_m=0.0)
                around = (*ring[position:], *ring[:position])[:-1]
                chain = self._joined((*lane_before.lanes, entry, *around))
                approach = self._approach(chain, sigma_m=RING_SMOOTHING_M, lane_before=before[0])
                entered_m = approach.mapped_from_m + chain.starts_m[len(lane_before.lanes) + 1]
                share = (approach.station_m - entered_m) / (approach.path.length_m - EXTENSION_M - entered_m)
                approaches.append(replace(approach, share_of_ring=min(max(share, 0.0), 1.0)))
        return approaches

    def _straight_on(self, lane_before: LaneRef) -> Approach:
        """Return the approach continued straight where no lane goes straight: the stem of a T, or the end of a road."""
        chain = self._chain(lane_before, upstream_m=self.back_m, downstream_m=0.0)
        approach = self._approach(chain)
        return replace(approach, name=f"{approach.name} straight on", extended=True)

    def _turning(self, seed: LaneRef, turn: Turn) -> Approach | None:
        before, after = self.network.predecessors(seed), self.network.successors(seed)
        if not before or not after:
            return None
        chain = self._chain(before[0], upstream_m=self.back_m, downstream_m=0.0)
        approach = self._approach(chain)
        x, y, z, heading = (float(value) for value in self._centre(after[0])[0])
        return replace(
            approach,
            name=f"{approach.name} turning {turn} into {after[0].road_id}:{after[0].lane_id}",
            lanes=(*chain.lanes, seed, after[0]),
            turn=turn,
            turn_from_m=approach.path.length_m - EXTENSION_M,
            exit_pose=Pose(x, y, heading, z),
            exit_road=self._road(after[0]),
        )

    def _approach(self, chain: _Chain, *, sigma_m: float = SMOOTHING_M, lane_before: LaneRef | None = None) -> Approach:
        path = through_points(chain.points, sigma_m=sigma_m)
        back_m = math.ceil(max(self.back_m - path.length_m, 0.0) / STEP_M) * STEP_M
        path = extended(path, back_m=back_m, ahead_m=EXTENSION_M)
        station, offset = path.project(self.x_m, self.y_m)
        index = int(np.searchsorted(np.array(chain.starts_m), station - back_m, side="right")) - 1
        index = min(max(index, 0), len(chain.lanes) - 1)
        outside = [i for i, ref in enumerate(chain.lanes) if self._road(ref).junction_id is None]
        if lane_before is not None:
            index = chain.lanes.index(lane_before)
        at = max((i for i in outside if i <= index), default=min(outside, default=index))
        following = [chain.lanes[i] for i in outside if i > index][:1] or [chain.lanes[at]]
        here = chain.lanes[at]
        return Approach(
            name=f"{here.road_id}:{here.lane_id}>{following[0].road_id}:{following[0].lane_id}",
            lanes=chain.lanes,
            path=path,
            station_m=station,
            offset_m=offset,
            mapped_from_m=back_m,
            beyond=following[0],
            **self._position(here),
        )

    def _position(self, here: LaneRef) -> dict[str, Any]:
        """Return the position of a lane among those of its road, as fields of an approach along it."""
        drivable = [
            lane for lane in self._road(here).lane_sections[here.section].lanes if lane.id != 0 and lane.type.drivable
        ]
        direction = self.network.direction(here)
        along = [lane.id for lane in drivable if self.network.direction(here._replace(lane_id=lane.id)) == direction]
        left_hand = self._road(here).left_hand  # the size of ids grows away from the centre
        return {
            "road": self._road(here),
            "lane_from_left": sorted(along, key=abs, reverse=left_hand).index(here.lane_id),
            "lanes_along": len(along),
            "lanes_total": len(drivable),
            "centre_lane_beside": any(lane.type is LaneType.BIDIRECTIONAL for lane in drivable),
            "lane_turns": self.network.lane(here).turns,
            "width_m": self.network.width_m(here, sum(self.network.lane_span(here)) / 2),
        }

    # --- following lanes ---------------------------------------------------------------------------------------
    def _chain(
        self, seed: LaneRef, *, upstream_m: float, downstream_m: float, keep: tuple[LaneRef, ...] = ()
    ) -> _Chain:
        """Return the seed with the straightest lanes added at both ends, up to both distances."""
        centre = self._centre(seed)
        s = arc_lengths(centre)
        here = float(s[int(np.argmin(np.hypot(centre[:, 0] - self.x_m, centre[:, 1] - self.y_m)))])
        behind, merged = self._behind(seed, upstream_m - here, keep)
        beyond = self._beyond(seed, downstream_m - (float(s[-1]) - here), behind, keep)
        chain = self._joined((*reversed(behind), *beyond[1:]))
        return self._merging(chain, *merged) if merged is not None else chain

    def _beyond(
        self, seed: LaneRef, wanted_m: float, taken: Collection[LaneRef], keep: tuple[LaneRef, ...]
    ) -> tuple[LaneRef, ...]:
        """Return the seed and the lanes that follow it, without those in ``taken``."""

        def onward(lanes: tuple[LaneRef, ...], following: Sequence[LaneRef]) -> Sequence[LaneRef]:
            options = [option for option in following if option not in lanes and option not in taken]
            return self._straightest(seed, options, keep) if self._covered_m(lanes) < wanted_m else ()

        return follow(self.network, seed, onward)[0]

    def _behind(
        self, seed: LaneRef, wanted_m: float, keep: tuple[LaneRef, ...]
    ) -> tuple[tuple[LaneRef, ...], tuple[LaneRef, LaneRef] | None]:
        """Return the seed and the lanes before it, backwards.

        If one of these begins beside a lane from which traffic merges into it, that pair of lanes is returned too.
        """
        merged: tuple[LaneRef, LaneRef] | None = None

        def onward(lanes: tuple[LaneRef, ...], preceding: Sequence[LaneRef]) -> Sequence[LaneRef]:
            nonlocal merged
            if self._covered_m(lanes) >= wanted_m:
                return ()
            options: Sequence[LaneRef] = [option for option in preceding if option not in lanes]
            if not options and merged is None and (beside := self._lane_before(lanes[-1])) is not None:
                merged = lanes[-1], beside
                options = self.network.predecessors(beside)
            return self._straightest(seed, options, keep)

        return follow(self.network, seed, onward, ahead=False)[0], merged

    def _covered_m(self, lanes: tuple[LaneRef, ...]) -> float:
        """Return the length of a way's lanes after its first."""
        return math.fsum(float(arc_lengths(self._centre(ref))[-1]) for ref in lanes[1:])

    def _straightest(self, seed: LaneRef, options: Sequence[LaneRef], keep: tuple[LaneRef, ...]) -> Sequence[LaneRef]:
        name = self._road(seed).name
        return [min(options, key=lambda option: self._detour(option, name, keep))] if options else ()

    def _lane_before(self, ref: LaneRef) -> LaneRef | None:
        """Return the lane beside one that begins here, from which traffic merges into it, or None.

        A shared middle lane is entered anywhere along it.
        """
        if self.network.lane(ref).type is LaneType.BIDIRECTIONAL:
            return None
        direction = self.network.direction(ref)
        for beside in self.network.neighbours(ref):
            if beside is None or self.network.lane(beside).type is LaneType.BIDIRECTIONAL:
                continue
            if self.network.direction(beside) == direction and self.network.predecessors(beside):
                return beside
        return None

    def _merging(self, chain: _Chain, begun: LaneRef, beside: LaneRef) -> _Chain:
        """Return the chain with a lane change from the lane beside it, where both lanes exist."""
        first = chain.lanes.index(begun)
        offsets: list[FloatArray] = []
        following: LaneRef | None = beside
        for ref in chain.lanes[first:]:
            if following is None or following.road_id != ref.road_id or following.section != ref.section:
                break
            offsets.append(self._centre(following)[:, :3] - self._centre(ref)[:, :3])
            after = [each for each in self.network.successors(following) if each not in chain.lanes]
            following = after[0] if len(after) == 1 else None
        begins = int(np.searchsorted(arc_lengths(chain.points), chain.starts_m[first] - 1e-6))
        apart = np.concatenate([offsets[0], *(piece[1:] for piece in offsets[1:])])
        points = chain.points.copy()
        along = arc_lengths(points[begins : begins + len(apart)])
        u = np.clip(along / max(min(float(along[-1]), MERGE_M), 1.0), 0.0, 1.0)
        points[begins : begins + len(apart)] += (1.0 - u * u * (3.0 - 2.0 * u))[:, None] * apart
        return _Chain(chain.lanes, points, chain.starts_m)

    def _joined(self, lanes: tuple[LaneRef, ...]) -> _Chain:
        pieces: list[FloatArray] = []
        starts: list[float] = []
        length = 0.0
        for ref in lanes:
            piece = self._centre(ref)[:, :3]
            starts.append(length)
            length += float(arc_lengths(piece)[-1])
            pieces.append(piece if not pieces else piece[1:])
        return _Chain(lanes, np.concatenate(pieces), tuple(starts))

    def _detour(self, ref: LaneRef, name: str, keep: tuple[LaneRef, ...]) -> tuple[float, LaneRef]:
        bend = float(np.abs(np.diff(self._centre(ref)[:, 3])).sum())
        road = self._road(ref)
        other_name = 0.3 if road.junction_id is None and name and road.name != name else 0.0
        return (round(bend + other_name - (10.0 if ref in keep else 0.0), 3), ref)

    def _ends_near(self, ref: LaneRef) -> bool:
        end = self._centre(ref)[-1]
        return math.hypot(float(end[0]) - self.x_m, float(end[1]) - self.y_m) <= JUNCTION_REACH_M

    def _goes_straight(self, ref: LaneRef) -> bool:
        return any(
            self._road(option).junction_id is None or self._turn(option) is None
            for option in self.network.successors(ref)
        )

    def _turn(self, connecting: LaneRef) -> Turn | None:
        """Return the turn of a connecting lane.

        It follows from its own ends or from the roads some way off, whichever turns less: maps often bend a carriageway
        into the junction's centre just before it, and roads often bend just beyond.
        """
        if connecting not in self._turns:
            heading = self._centre(connecting)[:, 3]
            inside = float(heading[-1] - heading[0])
            before, after = self.network.predecessors(connecting), self.network.successors(connecting)
            outside = inside
            if before and after:
                coming = self._heading_off(before[0], at_end=True)
                outside = wrap_angle(self._heading_off(after[0], at_end=False) - coming)
            angle = min(inside, outside, key=abs)
            back = before and after and before[0].road_id == after[0].road_id
            self._turns[connecting] = Turn.U_TURN if back else _named_turn(angle)
            self._angles[connecting] = angle
        return self._turns[connecting]

    def _slight_turn(self, connecting: LaneRef) -> Turn | None:
        """Return the turn as a driver would name it, if a road of another name branches off at an acute angle."""
        if self._turn(connecting) is not None or abs(self._angles[connecting]) < SLIGHT_TURN_RAD:
            return None
        before, after = self.network.predecessors(connecting), self.network.successors(connecting)
        if not before or not after or self._road(before[0]).name == self._road(after[0]).name:
            return None
        return Turn.LEFT if self._angles[connecting] > 0 else Turn.RIGHT

    def _heading_off(self, ref: LaneRef, *, at_end: bool) -> float:
        centre = self._centre(ref)
        s = arc_lengths(centre)
        wanted = max(float(s[-1]) - OFF_JUNCTION_M, 0.0) if at_end else min(OFF_JUNCTION_M, float(s[-1]))
        return float(centre[int(np.argmin(np.abs(s - wanted))), 3])

    def _road(self, ref: LaneRef) -> Road:
        return self.network.road_by_id[ref.road_id]

    def _centre(self, ref: LaneRef) -> FloatArray:
        if ref not in self._centres:
            self._centres[ref] = self.network.centreline(ref, 1.0)
        return self._centres[ref]


def _named_turn(angle_rad: float) -> Turn | None:
    if abs(angle_rad) >= U_TURN_RAD:
        return Turn.U_TURN
    if abs(angle_rad) < TURN_RAD:
        return None
    return Turn.LEFT if angle_rad > 0 else Turn.RIGHT
