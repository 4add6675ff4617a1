"""What a model can choose from: the candidate approaches of each vehicle, numbered, in the local frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

from trace_dag.states.candidates import Candidate
from trace_dag.states.scene import Scene
from trace_dag.states.streams import Stream

_SAMPLED_AT_M = (0.0, 10.0, 25.0, 50.0, 75.0, 100.0, 150.0)
_WITHIN_LANE_M = 3.0
_CENTIMETRES = 2  # digits


@dataclass(frozen=True, eq=False)
class Approach:
    """One candidate approach: a stream under a short id, and the vehicles it is open to."""

    id: str
    stream: Stream
    vehicles: tuple[int, ...]

    @property
    def length_m(self) -> float:
        """How far upstream of the crash the map follows it (or its straight continuation, off the map)."""
        begin = self.stream.mapped_from_m
        return self.stream.station_m - begin

    def heading_deg(self, before_m: float) -> float:
        """Direction of travel ``before_m`` metres before the crash, degrees counter-clockwise from east, 0 to 360."""
        pose = self.stream.path.pose(self.stream.station_m - before_m)
        return math.degrees(pose.heading_rad) % 360.0

    def described(self) -> dict[str, object]:
        """The approach as the model is told of it."""
        stream, road = self.stream, self.stream.road
        movement = f"turns {stream.turn.value} here" if stream.turn is not None else "passes the crash"
        if stream.turn is not None and stream.exit_road is not None and stream.exit_road.name:
            movement += f" into {stream.exit_road.name}"
        if stream.wrong_way:
            movement += ", against the traffic of this lane"
        here = stream.lanes[0] if stream.lanes else None
        points = []
        for before_m in _SAMPLED_AT_M:
            if before_m <= self.length_m:
                pose = stream.path.pose(stream.station_m - before_m)
                points.append([before_m, round(pose.x_m, 1), round(pose.y_m, 1), round(self.heading_deg(before_m))])
        return {
            "id": self.id,
            "open_to_vehicles": list(self.vehicles),
            "street": list(road.names) if road is not None else ["not on the map"],
            "road": road.id if road is not None else None,
            "lane": here.lane_id if here is not None else None,
            "lane_counted_from_left": stream.lane_from_left + 1,
            "lanes_in_this_direction": stream.lanes_along,
            "lanes_in_all": stream.lanes_total,
            "one_way": stream.one_way,
            "shared_centre_lane": stream.centre_lane,
            "speed_limit_mps": round(road.speed_mps, 1) if road is not None and road.speed_mps else None,
            "movement": movement,
            "known_for_m": round(self.length_m),
            "points_before_crash_m_x_y_heading": points,
        }


@dataclass(frozen=True, eq=False)
class Choices:
    """All approaches of one crash."""

    scene: Scene
    found: tuple[Candidate, ...]

    @cached_property
    def approaches(self) -> tuple[Approach, ...]:
        """Every stream on which some reading of the record puts a vehicle, in order of first mention."""
        streams: dict[str, Stream] = {}
        vehicles: dict[str, set[int]] = {}
        for candidate in self.found:
            for party, option in (
                (candidate.encounter.mover, candidate.mover),
                (candidate.encounter.other, candidate.other),
            ):
                streams.setdefault(option.stream.name, option.stream)
                vehicles.setdefault(option.stream.name, set()).add(party.vehicle.number)
        return tuple(
            Approach(f"C{number}", stream, tuple(sorted(vehicles[name])))
            for number, (name, stream) in enumerate(streams.items(), start=1)
        )

    def by_id(self, approach_id: str) -> Approach | None:
        """The approach with that id; None if there is none."""
        return next((approach for approach in self.approaches if approach.id == approach_id), None)

    def at(self, x_m: float, y_m: float, heading_deg: float, vehicle_number: int) -> list[Approach]:
        """The approaches of a vehicle on which a point lies, travelled in that direction; the nearest first.

        Several share a lane until they part at the crash, and lie equally near: those keep their order.
        """
        near: list[tuple[float, Approach]] = []
        for approach in self.approaches:
            if vehicle_number not in approach.vehicles:
                continue
            station, offset = approach.stream.path.project(x_m, y_m)
            before_m = approach.stream.station_m - station
            apart = abs(math.remainder(approach.heading_deg(max(before_m, 0.0)) - heading_deg, 360.0))
            if abs(offset) <= _WITHIN_LANE_M and -5.0 <= before_m <= approach.length_m and apart <= 60.0:
                near.append((round(abs(offset), _CENTIMETRES), approach))
        return [approach for _, approach in sorted(near, key=itemgetter(0))]

    def chosen(self, by_vehicle: dict[int, Approach]) -> list[Candidate]:
        """The candidates in which every vehicle is on its chosen approach."""
        kept = []
        for candidate in self.found:
            pairs = (
                (candidate.encounter.mover, candidate.mover),
                (candidate.encounter.other, candidate.other),
            )
            if all(option.stream.name == by_vehicle[party.vehicle.number].stream.name for party, option in pairs):
                kept.append(candidate)
        return kept
