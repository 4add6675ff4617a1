"""The choices of a model: the candidate approaches of each vehicle, numbered, in the local frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

from trace_dag.reconstruction.candidates import Candidate
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene

_SAMPLED_AT_M = (0.0, 10.0, 25.0, 50.0, 75.0, 100.0, 150.0)
_WITHIN_LANE_M = 3.0
_CENTIMETRES = 2  # digits


@dataclass(frozen=True, eq=False)
class OfferedApproach:
    """One candidate approach: an approach under a short id, and the vehicles it is open to."""

    id: str
    approach: Approach
    vehicles: tuple[int, ...]

    @property
    def length_m(self) -> float:
        """Return the length (m) of the approach that the map contains upstream of the crash."""
        begin = self.approach.mapped_from_m
        return self.approach.station_m - begin

    def heading_deg(self, before_m: float) -> float:
        """Return the direction of travel ``before_m`` before the crash, degrees CCW from east, 0 to 360."""
        pose = self.approach.path.pose(self.approach.station_m - before_m)
        return math.degrees(pose.heading_rad) % 360.0

    def described(self) -> dict[str, object]:
        """Return the description of the approach for the model."""
        approach, road = self.approach, self.approach.road
        movement = f"turns {approach.turn.value} here" if approach.turn is not None else "passes the crash"
        if approach.turn is not None and approach.exit_road is not None and approach.exit_road.name:
            movement += f" into {approach.exit_road.name}"
        if approach.wrong_way:
            movement += ", against the traffic of this lane"
        if approach.goes_either_way:
            movement += ", on a reversible road that may have gone either way at the hour"
        here = approach.lanes[0] if approach.lanes else None
        points = []
        for before_m in _SAMPLED_AT_M:
            if before_m <= self.length_m:
                pose = approach.path.pose(approach.station_m - before_m)
                points.append([before_m, round(pose.x_m, 1), round(pose.y_m, 1), round(self.heading_deg(before_m))])
        return {
            "id": self.id,
            "open_to_vehicles": list(self.vehicles),
            "street": list(road.names) if road is not None else ["not on the map"],
            "road": road.id if road is not None else None,
            "lane": here.lane_id if here is not None else None,
            "lane_counted_from_left": approach.lane_from_left + 1,
            "lanes_in_this_direction": approach.lanes_along,
            "lanes_in_all": approach.lanes_total,
            "one_way": approach.one_way,
            "shared_centre_lane": approach.centre_lane,
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
    def offered(self) -> tuple[OfferedApproach, ...]:
        """Return every approach that some reading of the record gives to a vehicle, in order of first mention."""
        approaches: dict[str, Approach] = {}
        vehicles: dict[str, set[int]] = {}
        for candidate in self.found:
            for party, option in (
                (candidate.scenario.mover, candidate.mover),
                (candidate.scenario.other, candidate.other),
            ):
                approaches.setdefault(option.approach.name, option.approach)
                vehicles.setdefault(option.approach.name, set()).add(party.vehicle.number)
        return tuple(
            OfferedApproach(f"C{number}", approach, tuple(sorted(vehicles[name])))
            for number, (name, approach) in enumerate(approaches.items(), start=1)
        )

    def by_id(self, approach_id: str) -> OfferedApproach | None:
        """Return the approach with that id, or None."""
        return next((offered for offered in self.offered if offered.id == approach_id), None)

    def at(self, x_m: float, y_m: float, heading_deg: float, vehicle_number: int) -> list[OfferedApproach]:
        """Return a vehicle's approaches through a point in a direction, the nearest first.

        Several approaches share a lane until they part at the crash and are equally near there; these keep their order.
        """
        near: list[tuple[float, OfferedApproach]] = []
        for offered in self.offered:
            if vehicle_number not in offered.vehicles:
                continue
            station, offset = offered.approach.path.project(x_m, y_m)
            before_m = offered.approach.station_m - station
            apart = abs(math.remainder(offered.heading_deg(max(before_m, 0.0)) - heading_deg, 360.0))
            if abs(offset) <= _WITHIN_LANE_M and -5.0 <= before_m <= offered.length_m and apart <= 60.0:
                near.append((round(abs(offset), _CENTIMETRES), offered))
        return [offered for _, offered in sorted(near, key=itemgetter(0))]

    def chosen(self, by_vehicle: dict[int, OfferedApproach]) -> list[Candidate]:
        """Return the candidates in which every vehicle is on its chosen approach."""
        kept = []
        for candidate in self.found:
            pairs = ((candidate.scenario.mover, candidate.mover), (candidate.scenario.other, candidate.other))
            if all(option.approach.name == by_vehicle[party.vehicle.number].approach.name for party, option in pairs):
                kept.append(candidate)
        return kept
