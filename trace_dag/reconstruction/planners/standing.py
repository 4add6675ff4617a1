"""Parties that stood on a vehicle's way after its first event: a parked vehicle, or a person on foot.

It is put where the vehicle comes along, so that both are touched on the reported areas. Nothing says where it stood but
the sequence of events.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import NonMotorist, VehicleRecord
from trace_dag.reconstruction.assemble import stand_still
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.motion.contact_points import contact_points_of
from trace_dag.reconstruction.planners.pedestrian_impact.hypothesis import standing_person
from trace_dag.reconstruction.planners.way_after import Way, ways_on
from trace_dag.simulation.states import ParticipantState

_SHARES: Final = (0.25, 0.5, 0.1, 0.75)  # of the way, at which it is tried
_LEAST_M: Final = 2.0  # from where the vehicle was


def standing_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield places for who stood on the ways that the vehicle can have gone on."""
    (number,) = (each for each in event.pair if each in course.numbers)
    since_s = course.last_event_s(number)
    if since_s is None:
        yield f"vehicle {number} meets nobody before it"
        return
    ways = ways_on(search, course, number, event.side)
    for on_its_way, assumed in ways:
        way = Way.of(search.scene.network, on_its_way.log, number, since_s)
        for state in _stood(search, way, event):
            yield Plan((*on_its_way.states, state), on_its_way.objects, detail=f"strikes it{assumed}")


def _stood(search: Search, way: Way, event: CrashEvent) -> Iterator[ParticipantState]:
    """Return the parties that stood, at some steps of the vehicle's way."""
    moved_m = np.cumsum([0.0, *(math.dist(a.xy_m, b.xy_m) for a, b in zip(way.poses, way.poses[1:], strict=False))])
    if moved_m[-1] < _LEAST_M:
        return
    own = event.as_struck(way.driven.number) if way.driven.number != event.party else None
    area = event.area if own is not None else event.partner_area
    areas = [each for _, each in way.striking(area, -math.inf)]
    for share in _SHARES:
        k = int(np.searchsorted(moved_m, max(share * moved_m[-1], _LEAST_M)))
        point = way.point(min(k, len(way.poses) - 1), areas[min(k, len(way.poses) - 1)])
        if point is None:
            continue
        k = min(k, len(way.poses) - 1)
        at = way.poses[k]
        touched = at.to_world(np.array([point.ahead_m, point.left_m]))
        outward_rad = at.heading_rad + math.atan2(point.normal[1], point.normal[0])
        if isinstance(event.partner, NonMotorist):
            yield standing_person(search.scene, event.partner, touched, outward_rad, at.z_m)
            continue
        other = event.partner if own is not None else event.vehicle
        assert isinstance(other, VehicleRecord)
        yield stand_still(search.scene.network, other, _parked_pose(way, k, event.as_struck(other.number), touched))


def _parked_pose(way: Way, k: int, parked: VehicleRecord, touched: np.ndarray) -> Pose:
    """Return the pose of a vehicle that stands along the road and is touched at a place.

    It is touched on its area of impact, at its rear if that is not known.
    """
    at, runs_rad = way.poses[k], way.runs_rad(k)
    heading = runs_rad if math.cos(runs_rad - at.heading_rad) >= 0 else runs_rad + math.pi
    half_length, half_width = parked.length_m / 2, parked.width_m / 2
    point = contact_points_of(parked.impact, half_length, half_width)[0]
    ahead, left = (point.ahead_m, point.left_m) if parked.impact is not None else (-half_length, 0.0)
    c, s = math.cos(heading), math.sin(heading)
    x, y = touched[0] - ahead * c + left * s, touched[1] - ahead * s - left * c
    return Pose(round(float(x), 6), round(float(y), 6), round(math.remainder(heading, math.tau), 6), at.z_m)
