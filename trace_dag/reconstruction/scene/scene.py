"""The crash on its map: record, network, place and the approaches past it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from trace_dag.common.messages.wording import count_of
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.scene.approach_finder import ApproachFinder
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement, MappedThing

if TYPE_CHECKING:
    from trace_dag.roads.map.areas import Area

CARRIAGEWAY_REACH_M = 120.0
BESIDE_ROAD_M = 5.0  # a reported point this near to its carriageway is used as it is
_ON_ROAD_M = 8.0  # the crash was not on a lane whose centre is farther away


def place_of(placement: CrashPlacement) -> tuple[float, float]:
    """Return the expected place of impact: the reported point, unless it was moved to another road.

    >>> place_of(map_report.placement)  # the point of the report is the origin of the local frame
    (0.0, 0.0)
    """
    return (0.0, 0.0) if placement.moved_m <= BESIDE_ROAD_M else (placement.x_m, placement.y_m)


@dataclass(frozen=True, eq=False)
class Scene:
    """The crash on its map, the base of every candidate."""

    record: CrashRecord
    network: RoadNetwork
    placement: CrashPlacement
    finder: ApproachFinder
    approaches: tuple[Approach, ...]
    things: tuple[MappedThing, ...] = ()

    @property
    def place_xy_m(self) -> tuple[float, float]:
        """Return the expected place of impact."""
        return place_of(self.placement)

    @property
    def on_road_m(self) -> float:
        """Return the greatest distance (m) of the crash's lane centre from the reported point.

        It includes the possible error of the point.
        """
        return _ON_ROAD_M + (self.record.position_accuracy_m or 0.0)

    @cached_property
    def carriageway(self) -> Area:
        """Return the area that traffic drives on around the crash, at its level."""
        place = self.placement
        return self.network.carriageway_near(place.x_m, place.y_m, CARRIAGEWAY_REACH_M, z_m=place.z_m)

    @property
    def through(self) -> list[Approach]:
        """Return streams that pass the crash without turning."""
        return [approach for approach in self.approaches if approach.turn is None]

    def no_way_that(self, does: str) -> str:
        """Return the sentence that no path past the crash has a property, such as "leads off the road"."""
        if not self.approaches:
            return "no lane of the map passes the crash"
        return f"{count_of(len(self.approaches), 'way')} past the crash, none of which {does}"

    def on_road(self, wanted: list[Approach]) -> list[Approach]:
        """Return approaches that pass within a lane or two of the crash, or else the nearest ones."""
        near = [approach for approach in wanted if abs(approach.offset_m) <= self.on_road_m]
        return near or wanted[:2]
