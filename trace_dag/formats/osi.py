"""ASAM OSI traces: a ``GroundTruth`` message for every moment of the crash, as players of OSI 3.8 read them.

``<key>_gt.osi`` is a single-channel trace: each message after its length, four bytes, little-endian. Moving objects
are in each message, at the middle of their bounding boxes; lanes, their borders and fixed objects, which do not move,
are in the first one. Frame: the crash's local frame, named in ``proj_string``.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trace_dag.crash.record import VehicleClass
from trace_dag.errors import UserError
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.flow.contract import CrashFiles
from trace_dag.geometry import FloatArray
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.sim.types import Body, BodyKind, SimulationLog, VehicleLog
from trace_dag.units import wrap_angle

if TYPE_CHECKING:
    from osi3.osi_groundtruth_pb2 import GroundTruth

STEP_S: Final = 0.05
_OSI_VERSION: Final = (3, 8, 0)
_UNITED_STATES: Final = 840  # ISO 3166-1 numeric
_FIRST_LANE_ID: Final = 10_000  # people are numbered from 1001 on
_CLASSES: Final = {
    VehicleClass.CAR: "TYPE_CAR",
    VehicleClass.SUV: "TYPE_CAR",
    VehicleClass.PICKUP: "TYPE_CAR",
    VehicleClass.VAN: "TYPE_VAN",
    VehicleClass.LIGHT_TRUCK: "TYPE_HEAVY_TRUCK",
    VehicleClass.TRUCK: "TYPE_HEAVY_TRUCK",
    VehicleClass.TRACTOR_TRAILER: "TYPE_HEAVY_TRUCK",
    VehicleClass.TRAILER: "TYPE_TRAILER",
    VehicleClass.BUS: "TYPE_BUS",
    VehicleClass.MOTORCYCLE: "TYPE_MOTORCYCLE",
}
_OBJECTS: Final = {  # SOE
    **dict.fromkeys((19,), "TYPE_BUILDING"),
    **dict.fromkeys((24, 25, 26, 52, 57), "TYPE_BARRIER"),
    **dict.fromkeys((30, 31, 46, 59), "TYPE_POLE"),
    **dict.fromkeys((33,), "TYPE_CURBSTONE"),
    **dict.fromkeys((39,), "TYPE_WALL"),
    **dict.fromkeys((41,), "TYPE_VEGETATION"),
    **dict.fromkeys((42,), "TYPE_TREE"),
}


class Osi:
    """``<key>_gt.osi`` for each crash. Needs the extra ``osi``."""

    def __init__(self, keys: Sequence[str]) -> None:
        try:
            import osi3.osi_groundtruth_pb2  # noqa: F401 - asked here, so that what is missing is said once
        except ImportError as error:
            raise UserError("OSI traces need osi-python: pip install 'trace-dag[osi]'") from error

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.formats.exporter.Exporter`."""
        log = crash.shown_log()
        assert log is not None, "a verified crash was simulated"
        return {f"{crash.key}_gt.osi": trace(crash.load(ROAD_MAP), log)}

    def beside(self) -> Mapping[str, bytes]:
        """Each trace explains itself."""
        return {}


def trace(network: RoadNetwork, log: SimulationLog) -> bytes:
    """The whole of a log as a trace of ``GroundTruth`` messages, one every :data:`STEP_S`."""
    from osi3.osi_groundtruth_pb2 import GroundTruth

    times = np.arange(0.0, log.duration_s + STEP_S / 2, STEP_S)
    motions = [(log.bodies[each.number], each.number, _states(each, times)) for each in log.vehicles]
    chunks = []
    for step, time_s in enumerate(times):
        message = GroundTruth(country_code=_UNITED_STATES, proj_string=network.frame.proj)
        message.version.version_major, message.version.version_minor, message.version.version_patch = _OSI_VERSION
        seconds = round(float(time_s), 3)
        message.timestamp.seconds = int(seconds)
        message.timestamp.nanos = round((seconds - int(seconds)) * 1000) * 1_000_000
        message.host_vehicle_id.value = min(number for body, number, _ in motions if not body.is_figure)
        for body, number, states in motions:
            _add_moving(message, body, number, states[step])
        if step == 0:
            _add_road(message, network)
            _add_objects(message, log)
        data = message.SerializeToString(deterministic=True)
        chunks += [struct.pack("<I", len(data)), data]
    return b"".join(chunks)


def _states(moved: VehicleLog, times: FloatArray) -> FloatArray:
    """Place of the middle, velocity, yaw, pitch, roll, yaw rate and acceleration at some times, shape (n, 11)."""
    columns = (moved.x_m, moved.y_m, moved.z_m + moved.above_road_m, moved.velocity_x_mps, moved.velocity_y_mps)
    angles = [np.unwrap(each) for each in (moved.heading_rad, moved.pitch_rad, moved.roll_rad)]
    velocities = (moved.velocity_x_mps, moved.velocity_y_mps)
    gained = [np.gradient(each, moved.time_s) if len(each) > 1 else np.zeros(len(each)) for each in velocities]
    return np.column_stack(
        [np.interp(times, moved.time_s, values) for values in (*columns, *angles, moved.yaw_rate_rps, *gained)]
    )


def _add_moving(message: GroundTruth, body: Body, number: int, state: FloatArray) -> None:
    from osi3.osi_object_pb2 import MovingObject

    moving = message.moving_object.add()
    moving.id.value = number
    x, y, z, vx, vy, yaw, pitch, roll, rate, ax, ay = (float(value) for value in state)
    base = moving.base
    _set(base.position, x=x, y=y, z=z)
    _set(base.velocity, x=vx, y=vy, z=0.0)
    _set(base.acceleration, x=ax, y=ay, z=0.0)
    _set(base.orientation, roll=wrap_angle(roll), pitch=wrap_angle(pitch), yaw=wrap_angle(yaw))
    _set(base.orientation_rate, yaw=rate)
    _set(base.dimension, length=body.length_m, width=body.width_m, height=body.height_m)
    on_foot = {BodyKind.PEDESTRIAN: MovingObject.TYPE_PEDESTRIAN, BodyKind.ANIMAL: MovingObject.TYPE_ANIMAL}
    if body.kind in on_foot:
        moving.type = on_foot[body.kind]
        return
    moving.type = MovingObject.TYPE_VEHICLE
    name = _CLASSES.get(body.vehicle_class, "TYPE_OTHER")
    if body.is_figure:
        name = "TYPE_BICYCLE" if body.kind is BodyKind.CYCLIST else "TYPE_MICROMOBILITY_DEVICE"
    moving.vehicle_classification.type = MovingObject.VehicleClassification.Type.Value(name)


def _add_road(message: GroundTruth, network: RoadNetwork) -> None:
    from osi3.osi_lane_pb2 import Lane, LaneBoundary

    shapes = [shape for shape in lane_shapes(network, drivable_only=True) if shape.length_m > 0.0]
    ids = {shape.ref: number for number, shape in enumerate(shapes, _FIRST_LANE_ID)}
    free = count(_FIRST_LANE_ID + len(shapes))
    for shape in shapes:
        lane = message.lane.add()
        lane.id.value = ids[shape.ref]
        about = lane.classification
        within = shape.junction_id is not None
        about.type = Lane.Classification.TYPE_INTERSECTION if within else Lane.Classification.TYPE_DRIVING
        about.centerline_is_driving_direction = True
        for point in shape.centre_m:
            _set(about.centerline.add(), x=point[0], y=point[1], z=point[2])
        for refs, name in ((shape.left, "left_adjacent_lane_id"), (shape.right, "right_adjacent_lane_id")):
            if refs in ids:
                getattr(about, name).add().value = ids[refs]
        for before, after in _pairs(shape.predecessors, shape.successors, ids):
            pairing = about.lane_pairing.add()
            if before is not None:
                pairing.antecessor_lane_id.value = before
            if after is not None:
                pairing.successor_lane_id.value = after
        for border, beside, name in (
            (shape.left_m, shape.left, "left_lane_boundary_id"),
            (shape.right_m, shape.right, "right_lane_boundary_id"),
        ):
            boundary = message.lane_boundary.add()
            boundary.id.value = next(free)
            kind = LaneBoundary.Classification
            inner = within or beside is not None
            boundary.classification.type = kind.TYPE_NO_LINE if inner else kind.TYPE_ROAD_EDGE
            for point in border:
                _set(boundary.boundary_line.add().position, x=point[0], y=point[1], z=point[2])
            getattr(about, name).add().value = boundary.id.value


def _pairs(
    before: Sequence[LaneRef], after: Sequence[LaneRef], ids: Mapping[LaneRef, int]
) -> list[tuple[int | None, int | None]]:
    """Every way through a lane: from each lane before it to each after it."""
    known_before: list[int | None] = [ids[ref] for ref in before if ref in ids]
    known_after: list[int | None] = [ids[ref] for ref in after if ref in ids]
    return [(one, other) for one in known_before or [None] for other in known_after or [None]]


def _add_objects(message: GroundTruth, log: SimulationLog) -> None:
    from osi3.osi_object_pb2 import StationaryObject

    for item in log.objects:
        standing = message.stationary_object.add()
        standing.id.value = item.number
        _set(standing.base.position, x=item.pose.x_m, y=item.pose.y_m, z=item.pose.z_m + item.height_m / 2)
        _set(standing.base.orientation, yaw=item.pose.heading_rad)
        _set(standing.base.dimension, length=item.length_m, width=item.width_m, height=item.height_m)
        kind = StationaryObject.Classification.Type.Value(_OBJECTS.get(item.code, "TYPE_OTHER"))
        standing.classification.type = kind


def _set(message: Any, **values: float) -> None:
    for name, value in values.items():
        setattr(message, name, float(value))
