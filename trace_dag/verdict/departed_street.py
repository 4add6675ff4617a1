"""The street that a vehicle left, compared with the reported ones.

A vehicle may leave the road near several streets, as at a corner. A motion along an unreported street
contradicts the report if a reported one is there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.crash.record import CrashRecord
from trace_dag.roads.crash_site.street_names import SAME_STREET, best_similarity
from trace_dag.roads.crash_site.streets import joined_by, roads_near
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import VehicleLog

_REACH_M: Final = 100.0
_STEP_S: Final = 0.1
_ALONG: Final = math.cos(math.radians(35))  # a lane that turns farther from the course is one that is crossed


@dataclass(frozen=True)
class DepartedStreet:
    """Names of the street on which a vehicle left the road, and of all streets within 100 m."""

    names: frozenset[str] = frozenset()
    near: frozenset[str] = frozenset()


NO_STREET: Final = DepartedStreet()


def find_departed_street(network: RoadNetwork, driven: VehicleLog, until_s: float) -> DepartedStreet:
    """Return the street under a vehicle when it was last on a lane of its direction before a time.

    Within a junction it is both the street from which the vehicle comes and the one it enters.

    >>> sorted(find_departed_street(network, log.vehicles[1], 1.0).names)  # vehicle 2 comes along Main Street
    ['Main Street', 'NE 411']
    """
    time_s = until_s
    while time_s >= float(driven.time_s[0]):
        columns = (driven.x_m, driven.y_m, driven.z_m, driven.velocity_x_mps, driven.velocity_y_mps)
        x, y, z, vx, vy = (float(np.interp(time_s, driven.time_s, values)) for values in columns)
        course = math.atan2(vy, vx)
        names: set[str] = set()
        for match in network.nearest_lanes(x, y, 0.0, z_m=z):
            road = network.road_by_id[match.lane.road_id]
            if abs(math.cos(network.pose(match.lane, match.s_m).heading_rad - course)) >= _ALONG:
                owners = (road,) if road.junction_id is None else joined_by(network, road)
                names.update(name for owner in owners for name in owner.names)
        if names:
            around = roads_near(network, x, y, _REACH_M)
            near = {name for road_id in around for name in network.road_by_id[road_id].names}
            return DepartedStreet(frozenset(names), frozenset(near))
        time_s -= _STEP_S
    return NO_STREET


def street_likeness(street: DepartedStreet, record: CrashRecord) -> tuple[float | None, bool | None, str]:
    """Return the likeness (0 to 1) of the street that the vehicle left to a reported one, and the comparison.

    The comparison tells whether it is the reported street, and otherwise its name; None if no reported street is on the
    map there.

    >>> street_likeness(NO_STREET, record)
    (None, None, '')
    """
    reported = [name for name in (record.trafficway_1, record.trafficway_2) if name]
    likeness, best_near = best_similarity(reported, street.names), best_similarity(reported, street.near)
    if likeness is None or best_near is None or best_near < SAME_STREET:
        return likeness, None, ""
    held = likeness >= SAME_STREET
    said = f"the vehicle leaves {', '.join(sorted(street.names))}, reported is {' / '.join(reported)}"
    return likeness, held, "" if held else said
