"""Lane links: inside a road, between roads, and through junctions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from trace_dag.roads.map.model import Connection, ContactPoint, Junction, Lane, LaneRef, Road


class LaneLinks:
    """Successors and predecessors of drivable lanes, in the direction of travel, found on first use."""

    def __init__(
        self,
        roads: Sequence[Road],
        junctions: Sequence[Junction],
        lanes: Mapping[LaneRef, Lane],
        drivable: Mapping[str, Sequence[LaneRef]],
    ) -> None:
        """Link the lanes that traffic drives in, by road: ``drivable``."""
        self._roads = roads
        self._road_by_id = {road.id: road for road in roads}
        self._junctions = junctions
        self._lanes = lanes
        self._drivable = drivable
        self._successors: dict[LaneRef, tuple[LaneRef, ...]] = {}
        self._predecessors: dict[LaneRef, tuple[LaneRef, ...]] = {}

    def successors(self, ref: LaneRef) -> tuple[LaneRef, ...]:
        """Return lanes that follow at the lane's end."""
        if ref not in self._successors:
            found = self._find(ref) if self._is_drivable(ref) else ()
            self._successors[ref] = tuple(dict.fromkeys(found))
        return self._successors[ref]

    def predecessors(self, ref: LaneRef) -> tuple[LaneRef, ...]:
        """Return lanes that lead to the lane's begin."""
        if ref not in self._predecessors:
            self._predecessors[ref] = tuple(
                lane
                for road in self._leading_to.get(ref.road_id, ())
                for lane in self._drivable[road.id]
                if ref in self.successors(lane)
            )
        return self._predecessors[ref]

    @cached_property
    def _leading_to(self) -> dict[str, list[Road]]:
        """Return, for each road id, the roads from which that road can be entered, and itself, in network order."""
        found: dict[str, dict[str, None]] = {}
        for road in self._roads:
            found.setdefault(road.id, {})[road.id] = None
            for linked in road.linked_roads:
                found.setdefault(linked, {})[road.id] = None
        for junction in self._junctions:
            for connection in junction.connections:
                found.setdefault(connection.connecting_road, {})[connection.incoming_road] = None
        position = {road.id: number for number, road in enumerate(self._roads)}
        return {
            road_id: [self._roads[number] for number in sorted(position[each] for each in ids if each in position)]
            for road_id, ids in found.items()
        }

    @cached_property
    def _connections_from(self) -> dict[tuple[str, str], list[Connection]]:
        """Return connections by junction and incoming road."""
        found: dict[tuple[str, str], list[Connection]] = {}
        for junction in self._junctions:
            for connection in junction.connections:
                found.setdefault((junction.id, connection.incoming_road), []).append(connection)
        return found

    def _find(self, ref: LaneRef) -> list[LaneRef]:
        road = self._road_by_id[ref.road_id]
        lane = self._lanes[ref]
        forward = road.direction(ref.lane_id) > 0
        linked_id = lane.successor if forward else lane.predecessor
        next_section = ref.section + (1 if forward else -1)
        if 0 <= next_section < len(road.lane_sections):
            return self._entered(road.id, next_section, linked_id, forward)
        link = road.successor if forward else road.predecessor
        if link is None:
            return []
        if link.element_type == "road":
            return self._entered_at(link.element_id, link.contact_point, linked_id)
        found: list[LaneRef] = []
        for connection in self._connections_from.get((link.element_id, road.id), ()):
            if self._leaves_from_end(connection, road, forward):
                for from_id, to_id in connection.lane_links:
                    if from_id == ref.lane_id:
                        found += self._entered_at(connection.connecting_road, connection.contact_point, to_id)
        return found

    def _leaves_from_end(self, connection: Connection, road: Road, at_end: bool) -> bool:
        """Return whether a connection starts at the given end of its incoming road.

        A road may touch a junction twice.
        """
        connecting = self._road_by_id.get(connection.connecting_road)
        if connecting is None:
            return False
        link = connecting.predecessor if connection.contact_point == "start" else connecting.successor
        if link is None or link.element_id != road.id or link.contact_point is None:
            return True
        return (link.contact_point == "end") == at_end

    def _entered_at(self, road_id: str, contact: ContactPoint | None, lane_id: int | None) -> list[LaneRef]:
        road = self._road_by_id.get(road_id)
        if road is None or contact is None:
            return []
        at_start = contact == "start"
        return self._entered(road_id, 0 if at_start else len(road.lane_sections) - 1, lane_id, at_start)

    def _entered(self, road_id: str, section: int, lane_id: int | None, along: bool) -> list[LaneRef]:
        """Return the lane, if traffic drives in it and in that direction."""
        if lane_id is None:
            return []
        ref = LaneRef(road_id, section, lane_id)
        goes_along = self._road_by_id[road_id].direction(lane_id) > 0
        return [ref] if self._is_drivable(ref) and goes_along == along else []

    def _is_drivable(self, ref: LaneRef) -> bool:
        lane = self._lanes.get(ref)
        return lane is not None and lane.type.drivable
