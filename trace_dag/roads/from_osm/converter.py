"""The interface of a converter, which makes a road network from an extract, and the limits for its maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import RoadSettings
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.turn_curves import CORNER_RADIUS_M, TIGHTEST_RADIUS_M
from trace_dag.roads.map.curves import SHORTEST_ELEMENT_M
from trace_dag.roads.map.network import RoadNetwork


@dataclass(frozen=True)
class MapLimits:
    """Thresholds of the gates. The native converter guarantees the defaults.

    With infinity a gate only measures.
    """

    rule_violations: float = 0
    stored_difference_m: float = 1e-3
    mean_way_deviation_m: float = 0.25
    worst_way_deviation_m: float = 3.0  # of public ways; bends of driveways are sharper than a car can turn
    share_within_1m: float = 0.9  # drawn corners cut by driveable bends: parking lots have most
    ways_missing: float = 0
    lanes_against_tags: float = 0.0  # share of tagged roads that differ
    link_gap_m: float = 0.01  # as the official checker
    link_kink_deg: float = 1.0
    turn_radius_m: float = CORNER_RADIUS_M
    u_turn_radius_m: float = TIGHTEST_RADIUS_M
    shortest_element_m: float = SHORTEST_ELEMENT_M
    geodesic_m: float = 1.0
    grade: float = 0.08
    ramp_grade: float = 0.12
    clearance_m: float = 4.5
    crash_outside_m: float = 0.01
    crosswalk_m: float = 3.0  # of its crossing in OpenStreetMap from a crosswalk's outline
    lanes_beside_on_roadway: float = 0.05  # share of sidewalks and cycle lanes


@dataclass(frozen=True)
class WayHints:
    """Reported facts about one way, used only where the way's tags have none."""

    lanes: int | None = None  # in all, both directions and centre turn lane included
    speed_mps: float | None = None


class Converter(Protocol):
    """A converter, offered as an entry point of the group ``trace_dag.converters``: a class without arguments."""

    limits: MapLimits

    def require(self) -> None:
        """Raise :class:`trace_dag.common.errors.UserError` if something is not installed, before anything runs."""

    def convert(
        self, extract: OsmExtract, frame: LocalFrame, settings: RoadSettings, hints: Mapping[int, WayHints]
    ) -> RoadNetwork:
        """Return the road network of an extract, in ``frame``; one-way ways have the direction of their traffic.

        ``hints`` are by OSM way id.

        Raises :class:`trace_dag.common.errors.Rejection` (``map_distorted``) if no map can be made of the extract.
        """
