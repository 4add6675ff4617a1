"""The path of a vehicle after its first contact, and alternatives to it, for later events.

After a crash of vehicles nobody drives; a driver who strikes a person or an animal drives on. The path is simulated. If
it does not lead to the reported event, the vehicle is assumed out of control with its front wheels turned, by the least
angle that does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.common.units import bearing_to_clock_h, kmh_to_mps
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.derive import impact_area
from trace_dag.crash.record import ImpactArea, VehicleClass
from trace_dag.reconstruction.course import Course, Search
from trace_dag.reconstruction.motion.contact import ContactPoint, contact_points_of
from trace_dag.reconstruction.motion.departure_paths import SIGN
from trace_dag.roads.map.areas import Area
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import roadside_at
from trace_dag.simulation.leaving_road import find_departure_after_contact
from trace_dag.simulation.states import LossOfControl
from trace_dag.simulation.types import PULSE_S, Body, SimulationLog, VehicleLog

_REACH_M: Final = 250.0  # farther from a contact nobody slides
_CREEPS_MPS: Final = 0.5
STRIKES_MPS: Final = kmh_to_mps(8.0)
"""Slower than this nobody strikes anything that a report would name: no recorder has to record it (49 CFR 563.5)."""
_MEETS: Final = 0.1  # a face that moves so little ahead strikes nothing
_TURNED_DEG: Final = (1.0, 2.0, 4.0, 8.0, 16.0)  # of front wheels: the least that leads there is taken
_SPINS_RPS: Final = (1.5, -1.5, 3.0, -3.0)  # after impacts off the middle


def ways_on(
    search: Search,
    course: Course,
    number: int,
    side: DepartureSide | None,
    *,
    tripped: bool = False,
    least_mps: float = _CREEPS_MPS,
) -> Iterator[tuple[Course, str]]:
    """Yield the possible further courses of a vehicle, each with a text on its assumption.

    First its wheels roll, then its front wheels are turned ever more to the side on which it left the road, or to both
    if none is reported.

    Turned wheels have no effect if it moves at less than ``least_mps`` when it can lose control.

    If it is ``tripped`` its wheels dig in, or catch at a kerb, and it may spin instead: nearly all vehicles that
    overturn are tripped (NHTSA, DOT HS 809 438, 2002: 95 % of single-vehicle rollovers), and no report names the cause.
    """
    yield course, ""
    state, since_s = course.state_of(number), course.last_event_s(number)
    if since_s is None or state.vehicle_class is VehicleClass.MOTORCYCLE:
        return
    from_s = round(since_s + PULSE_S, 6)
    driven = course.log.vehicle_log(number)
    if not _moves(driven, least_mps)[driven.time_s >= from_s].any():
        return
    for loss in _tripped(from_s, side) if tripped else _steered(from_s, side):
        if search.is_over:
            return
        lost = replace(state, losses_of_control=(*state.losses_of_control, loss))
        yield search.changed(course, lost), f", taken to be out of control{_words(loss)}"


def _steered(from_s: float, side: DepartureSide | None) -> Iterator[LossOfControl]:
    for locked, turned_deg, to in product((None, 0.0), _TURNED_DEG, _sides_of(side)):
        yield LossOfControl(from_s, wheels_rad=_turned_rad(to, turned_deg), locked_wheels=locked)


def _tripped(from_s: float, side: DepartureSide | None) -> Iterator[LossOfControl]:
    yield LossOfControl(from_s, digs_in=True)
    for turned_deg, to in product(_TURNED_DEG[-2:], _sides_of(side)):
        yield LossOfControl(from_s, wheels_rad=_turned_rad(to, turned_deg), locked_wheels=0.0, digs_in=True)
    for yaw_rps in _SPINS_RPS:
        yield LossOfControl(from_s, yaw_rps=yaw_rps, locked_wheels=1.0, digs_in=True)


def _sides_of(side: DepartureSide | None) -> list[DepartureSide]:
    return [to for to in (DepartureSide.RIGHT, DepartureSide.LEFT) if side in (to, None)]


def _turned_rad(to: DepartureSide, turned_deg: float) -> float:
    return round(SIGN[to] * math.radians(turned_deg), 6)


def _words(loss: LossOfControl) -> str:
    words = ""
    if loss.wheels_rad:
        side = "left" if loss.wheels_rad > 0 else "right"
        words += f", its front wheels turned by {abs(math.degrees(loss.wheels_rad)):.0f}° to the {side}"
    if loss.yaw_rps:
        words += f", spinning at {abs(math.degrees(loss.yaw_rps)):.0f}° a second"
    words += ", its wheels rolling" if loss.locked_wheels == 0.0 else ""
    return words + (", its wheels digging in" if loss.digs_in else "")


@dataclass(frozen=True, eq=False)
class Way:
    """A vehicle's path after a time.

    It has the steps of the log in which the vehicle moves, its poses, and the distances of its four corners beyond the
    edge of the carriageway (shape (k, 4), m, negative within it).
    """

    network: RoadNetwork
    area: Area
    log: SimulationLog
    driven: VehicleLog
    body: Body
    steps: NDArray[np.intp]
    poses: tuple[Pose, ...]
    beyond_m: FloatArray
    outlines: NDArray[np.object_]

    @classmethod
    def of(cls, network: RoadNetwork, log: SimulationLog, number: int, since_s: float) -> Way:
        """Return the way of a vehicle of a log."""
        driven = log.vehicle_log(number)
        body = log.bodies[number]
        steps = np.flatnonzero((driven.time_s > since_s) & _moves(driven))
        steps = steps if len(steps) else np.array([len(driven.time_s) - 1])
        columns = np.stack([driven.x_m, driven.y_m, driven.heading_rad, driven.z_m], axis=-1)[steps]
        poses = tuple(Pose(*map(float, row)) for row in columns)
        area = network.carriageway_near(poses[0].x_m, poses[0].y_m, _REACH_M, z_m=poses[0].z_m)
        corners = np.concatenate([rectangle_corners(pose, body.length_m, body.width_m) for pose in poses])
        beyond_m = area.beyond_m(corners[:, 0], corners[:, 1]).reshape(-1, 4)
        outlines = np.asarray(shapely.polygons(corners.reshape(-1, 4, 2)))
        return cls(network, area, log, driven, body, steps, poses, beyond_m, outlines)

    @property
    def speeds_mps(self) -> FloatArray:
        """Return the speed at each of its steps."""
        return np.hypot(self.driven.velocity_x_mps, self.driven.velocity_y_mps)[self.steps]

    def slip_rad(self, k: int) -> float:
        """Return the heading less the course at a step."""
        step = self.steps[k]
        course = math.atan2(self.driven.velocity_y_mps[step], self.driven.velocity_x_mps[step])
        return math.remainder(self.poses[k].heading_rad - course, math.tau)

    def runs_rad(self, k: int) -> float:
        """Return the direction of the road beside the vehicle at a step, or that of the vehicle without a road."""
        pose = self.poses[k]
        place = roadside_at(self.network, pose.x_m, pose.y_m, z_m=pose.z_m)
        return pose.heading_rad if place is None else place.along_rad

    def point(self, k: int, area: ImpactArea | None) -> ContactPoint | None:
        """Return the point of an area of impact that could strike an object at a step.

        None if the point does not move ahead.
        """
        slip_rad = self.slip_rad(k)
        goes = (math.cos(slip_rad), -math.sin(slip_rad))
        points = contact_points_of(area, self.body.length_m / 2, self.body.width_m / 2)
        return next((each for each in points if np.dot(goes, each.normal) > _MEETS), None)

    def striking(self, area: ImpactArea | None, least_m: float) -> list[tuple[float, ImpactArea | None]]:
        """Return, for each step, the distance of the striking part beyond the edge (m), and the area of impact.

        The distance is -inf if the part does not move ahead. The area is the reported one, if that ever moves ahead so
        far beyond the edge, else the foremost.
        """
        reported = self._touching([area] * len(self.poses)) if area is not None else []
        if any(beyond_m >= least_m for beyond_m, _ in reported):
            return reported
        return self._touching([_ahead(self.slip_rad(k)) for k in range(len(self.poses))])

    def _touching(self, areas: Sequence[ImpactArea | None]) -> list[tuple[float, ImpactArea | None]]:
        points = [self.point(k, area) for k, area in enumerate(areas)]
        places = np.array(
            [
                self.poses[k].to_world(np.array([point.ahead_m, point.left_m]))
                for k, point in enumerate(points)
                if point is not None
            ]
        ).reshape(-1, 2)
        beyond_m = iter(self.area.beyond_m(places[:, 0], places[:, 1]).tolist() if len(places) else ())
        return [
            (-math.inf if point is None else next(beyond_m), each) for point, each in zip(points, areas, strict=True)
        ]

    def left_to(self, side: DepartureSide | None, k: int) -> bool:
        """Return whether the vehicle had left the road to a side by a step; None accepts any side."""
        return side is None or side in self.sides(k)

    def sides(self, k: int) -> tuple[DepartureSide, ...]:
        """Return the side on which the vehicle left the road by a step."""
        until_s = float(self.driven.time_s[self.steps[k]])
        return find_departure_after_contact(self.network, self.log, self.driven.number, until_s)

    def why_not(self, side: DepartureSide | None) -> str:
        """Return a sentence, with the measured value, on why an object has no place on the path."""
        who = f"vehicle {self.driven.number}"
        farthest_m = float(self.beyond_m.max())
        if farthest_m <= 0:
            return f"{who} stays on the carriageway: it comes to {-farthest_m:.1f} m from its edge"
        k = int(np.argmax(self.beyond_m.max(axis=1)))
        if not self.left_to(side, k):
            went = " or ".join(self.sides(k))
            return f"{who} comes {farthest_m:.1f} m beyond the edge: it leaves the road {went}, reported is {side}"
        return f"{who} comes {farthest_m:.1f} m beyond the edge at most, with no part ahead that could strike anything"


def _moves(driven: VehicleLog, least_mps: float = _CREEPS_MPS) -> NDArray[np.bool_]:
    """Return whether a vehicle moves at least that fast, at each step of its log."""
    return np.asarray(np.hypot(driven.velocity_x_mps, driven.velocity_y_mps) >= least_mps)


def _ahead(slip_rad: float) -> ImpactArea | None:
    """Return the area of impact of the foremost part."""
    return impact_area(round(bearing_to_clock_h(-slip_rad)) or 12)
