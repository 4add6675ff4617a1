"""ASAM OSI traces: a ``GroundTruth`` message for every moment of the crash, as players of OSI 3.8 read them.

``<key>_gt.osi`` is a single-channel trace: each message after its length, four bytes, little-endian. Moving objects are
in each message, at the middle of their bounding boxes; lanes, their borders with markings, crosswalks, signs,
fixed objects, time, light and weather, which do not change, are in the first one. Lights
with a program are in each message as three lamps, by the first reading of the report
(:func:`trace_dag.scenario.lights.crash_lights`); the state of others is unknown.
Frame: the crash's local frame, named in ``proj_string``.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trace_dag.agents.stored_traffic import traffic_of
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import wrap_angle
from trace_dag.crash.parties import SURROUNDING
from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.formats.lane_rules import mark_of, place_of
from trace_dag.flow.artefacts import RECORD, ROAD_MAP
from trace_dag.flow.contract import CrashFiles
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.model import Crosswalk, LaneRef, Road, Signal, SignalType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.lights import Colour, crash_lights
from trace_dag.scenario.openscenario_environment import conditions_of
from trace_dag.scenario.traffic.surrounding import add_traffic
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, VehicleLog

if TYPE_CHECKING:
    from osi3.osi_groundtruth_pb2 import GroundTruth
    from osi3.osi_trafficlight_pb2 import TrafficLight

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

_SIGNS: Final[Mapping[str, str]] = {
    SignalType.YIELD: "TYPE_GIVE_WAY",
    SignalType.STOP: "TYPE_STOP",
    SignalType.LIMIT: "TYPE_SPEED_LIMIT_BEGIN",
}
_LINES: Final = {"solid": "TYPE_SOLID_LINE", "broken": "TYPE_DASHED_LINE"}
_COLOURS: Final = {"yellow": "COLOR_YELLOW"}
# By LGT_COND, the level of OSI that has the light of the day (above 1,000 lx), of dawn and dusk (20 to 400 lx), of lit
# streets (3 to 10 lx) and of none.
_ILLUMINATION: Final = {1: 8, 2: 1, 3: 4, 4: 6, 5: 6}
_PRECIPITATION: Final = (  # mm/h, as OSI divides it
    (0.1, "PRECIPITATION_NONE"),
    (0.5, "PRECIPITATION_VERY_LIGHT"),
    (1.9, "PRECIPITATION_LIGHT"),
    (8.1, "PRECIPITATION_MODERATE"),
    (34.0, "PRECIPITATION_HEAVY"),
    (149.0, "PRECIPITATION_VERY_HEAVY"),
    (math.inf, "PRECIPITATION_EXTREME"),
)
_FOG: Final = (  # m of visibility, as OSI divides it
    (200.0, "FOG_DENSE"),
    (500.0, "FOG_THICK"),
    (1000.0, "FOG_LIGHT"),
    (2000.0, "FOG_MIST"),
    (4000.0, "FOG_POOR_VISIBILITY"),
    (10_000.0, "FOG_MODERATE_VISIBILITY"),
    (40_000.0, "FOG_GOOD_VISIBILITY"),
    (math.inf, "FOG_EXCELLENT_VISIBILITY"),
)


class Osi(Exporter):
    """``<key>_gt.osi`` for each crash. Needs the extra ``osi``."""

    def __init__(self, keys: Sequence[str]) -> None:
        try:
            import osi3.osi_groundtruth_pb2  # noqa: F401 - asked here, so that what is missing is said once
        except ImportError as error:
            raise UserError("OSI traces need osi-python: pip install 'trace-dag[osi]'") from error

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        log = crash.shown_log()
        assert log is not None, "a verified crash was simulated"
        surrounded = add_traffic(log, traffic_of(crash))
        return {f"{crash.key}_gt.osi": trace(crash.load(ROAD_MAP), surrounded, crash.load(RECORD))}


def trace(network: RoadNetwork, log: SimulationLog, record: CrashRecord) -> bytes:
    """Return the whole of a log as a trace of ``GroundTruth`` messages, one every :data:`STEP_S`."""
    from osi3.osi_groundtruth_pb2 import GroundTruth

    times = np.arange(0.0, log.duration_s + STEP_S / 2, STEP_S)
    motions = [(log.bodies[each.number], each, _states(each, times)) for each in log.vehicles]
    lights = next(iter(crash_lights(record, network, log)), None)
    cycle_of = {} if lights is None else lights.cycle_of
    lamps: list[tuple[str, Colour, TrafficLight]] = []
    chunks = []
    for step, time_s in enumerate(times):
        message = GroundTruth(country_code=_UNITED_STATES, proj_string=network.frame.proj)
        message.version.version_major, message.version.version_minor, message.version.version_patch = _OSI_VERSION
        seconds = round(float(time_s), 3)
        message.timestamp.seconds = int(seconds)
        message.timestamp.nanos = round((seconds - int(seconds)) * 1000) * 1_000_000
        message.host_vehicle_id.value = min(each.number for body, each, _ in motions if not body.is_figure)
        for body, each, states in motions:
            if each.number <= SURROUNDING or each.time_s[0] - 1e-6 <= time_s <= each.time_s[-1] + 1e-6:
                _add_moving(message, body, each.number, states[step])
        if step == 0:
            lamps = list(_add_road(message, network, cycle_of))
            _add_objects(message, log)
            _add_conditions(message, record)
        for signal_id, colour, lamp in lamps:
            shown, kind = message.traffic_light.add(), lamp.Classification
            shown.CopyFrom(lamp)
            shown.classification.mode = (
                kind.MODE_CONSTANT if cycle_of[signal_id].at(seconds) is colour else kind.MODE_OFF
            )
        data = message.SerializeToString(deterministic=True)
        chunks += [struct.pack("<I", len(data)), data]
    return b"".join(chunks)


def _states(moved: VehicleLog, times: FloatArray) -> FloatArray:
    """Return the middle, velocity, yaw, pitch, roll, yaw rate and acceleration at some times, shape (n, 11)."""
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


def _add_road(
    message: GroundTruth, network: RoadNetwork, with_program: Collection[str]
) -> Iterator[tuple[str, Colour, TrafficLight]]:
    """Add what does not change; yield the lamps of lights that do, by the map's signals."""
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
        for border, beside, name, mark in (
            (shape.left_m, shape.left, "left_lane_boundary_id", mark_of(network, shape.ref, left=True)),
            (shape.right_m, shape.right, "right_lane_boundary_id", mark_of(network, shape.ref, left=False)),
        ):
            boundary = message.lane_boundary.add()
            boundary.id.value = next(free)
            kind = LaneBoundary.Classification
            if mark is not None and not within:
                boundary.classification.type = kind.Type.Value(_LINES[mark[0]])
                boundary.classification.color = kind.Color.Value(_COLOURS.get(mark[1], "COLOR_WHITE"))
            else:
                inner = within or beside is not None
                boundary.classification.type = kind.TYPE_NO_LINE if inner else kind.TYPE_ROAD_EDGE
            for point in border:
                _set(boundary.boundary_line.add().position, x=point[0], y=point[1], z=point[2])
            getattr(about, name).add().value = boundary.id.value
    return _roadside(message, network, with_program, ids, free)


def _roadside(
    message: GroundTruth,
    network: RoadNetwork,
    with_program: Collection[str],
    ids: Mapping[LaneRef, int],
    free: count[int],
) -> Iterator[tuple[str, Colour, TrafficLight]]:
    for road in network.roads:
        for signal in road.signals:
            if signal.id in with_program:
                yield from _lamps(message, network, road, signal, ids, free)
            else:
                _add_signal(message, network, road, signal, ids, next(free))
        for crosswalk in road.crosswalks:
            if crosswalk.marked:
                _add_crosswalk(message, network, road, crosswalk, next(free))


def _lamps(
    message: GroundTruth, network: RoadNetwork, road: Road, signal: Signal, ids: Mapping[LaneRef, int], free: count[int]
) -> Iterator[tuple[str, Colour, TrafficLight]]:
    """Yield the lamps of a light, each beside its signal: from above red, yellow and green."""
    for k, colour in enumerate(Colour):
        _add_signal(alone := type(message)(), network, road, signal, ids, next(free))
        for lamp in alone.traffic_light:
            lamp.classification.color = lamp.Classification.Color.Value(f"COLOR_{colour.upper()}")
            lamp.base.position.z += (1 - k) * signal.height_m / 3
            lamp.base.dimension.height = signal.height_m / 3
            yield signal.id, colour, lamp


def _add_signal(
    message: GroundTruth, network: RoadNetwork, road: Road, signal: Signal, ids: Mapping[LaneRef, int], number: int
) -> None:
    from osi3.osi_trafficlight_pb2 import TrafficLight
    from osi3.osi_trafficsign_pb2 import TrafficSign, TrafficSignValue

    lanes = [
        ref
        for ref in network.drivable_lanes_of(road)
        for begin_m, end_m in [network.lane_span(ref)]
        if ref in ids and begin_m <= signal.s_m <= end_m and ref.lane_id in road.lanes_under(signal)
    ]
    if not lanes or signal.type not in (SignalType.LIGHT, *_SIGNS):
        return
    pose = network.pose(lanes[0], signal.s_m)
    x, y, z = place_of(network, road.id, signal)
    if signal.type == SignalType.LIGHT:
        added = message.traffic_light.add()
        base, about = added.base, added.classification
        about.color, about.mode = TrafficLight.Classification.COLOR_UNKNOWN, TrafficLight.Classification.MODE_UNKNOWN
    else:
        added = message.traffic_sign.add()
        base, about = added.main_sign.base, added.main_sign.classification
        kind = TrafficSign.MainSign.Classification
        about.type, about.variability = kind.Type.Value(_SIGNS[signal.type]), TrafficSign.VARIABILITY_FIXED
        if signal.value is not None:
            about.value.value = signal.value
            about.value.value_unit = TrafficSignValue.UNIT_MILE_PER_HOUR
    added.id.value = number
    _set(base.position, x=x, y=y, z=z + signal.height_m / 2)
    _set(base.orientation, yaw=wrap_angle(pose.heading_rad + math.pi))  # it looks at who comes
    _set(base.dimension, length=0.0, width=signal.width_m, height=signal.height_m)
    for ref in lanes:
        about.assigned_lane_id.add().value = ids[ref]


def _add_crosswalk(message: GroundTruth, network: RoadNetwork, road: Road, crosswalk: Crosswalk, number: int) -> None:
    from osi3.osi_roadmarking_pb2 import RoadMarking
    from osi3.osi_trafficsign_pb2 import TrafficSign

    x, y, heading, _ = network.road_geometry(road.id).line.at(crosswalk.s_m)
    ahead, left = (np.array(each) for each in zip(*crosswalk.outline_m, strict=True))
    marking = message.road_marking.add()
    marking.id.value = number
    marking.classification.type = RoadMarking.Classification.TYPE_SYMBOLIC_TRAFFIC_SIGN
    marking.classification.traffic_main_sign_type = TrafficSign.MainSign.Classification.TYPE_ZEBRA_CROSSING
    marking.classification.monochrome_color = RoadMarking.Classification.COLOR_WHITE
    middle = (ahead.max() + ahead.min()) / 2, (left.max() + left.min()) / 2
    height_m = min(
        (network.pose(ref, s_m).z_m for ref in network.drivable_lanes_of(road) for s_m in network.lane_span(ref)),
        key=lambda z: abs(z),
        default=0.0,
    )
    _set(
        marking.base.position,
        x=x + middle[0] * math.cos(heading) - middle[1] * math.sin(heading),
        y=y + middle[0] * math.sin(heading) + middle[1] * math.cos(heading),
        z=height_m,
    )
    _set(marking.base.orientation, yaw=heading)
    _set(marking.base.dimension, length=np.ptp(ahead), width=np.ptp(left), height=0.0)


def _add_conditions(message: GroundTruth, record: CrashRecord) -> None:
    """Add time, light, sun and weather, as far as reported."""
    when, sun, weather = conditions_of(record)
    told, kind = message.environmental_conditions, type(message.environmental_conditions)
    if record.light_code in _ILLUMINATION:
        told.ambient_illumination = kind.AmbientIllumination.Value(
            f"AMBIENT_ILLUMINATION_LEVEL{_ILLUMINATION[record.light_code]}"
        )
    if when is not None:
        told.time_of_day.seconds_since_midnight = when.hour * 3600 + when.minute * 60
    if sun is not None:
        _set(told.sun, azimuth=sun[0], elevation=sun[1])
    if weather is not None:
        rain = next(name for most, name in _PRECIPITATION if weather.rate_mm_per_h <= most)
        fog = next(name for most, name in _FOG if weather.visual_range_m <= most)
        told.precipitation, told.fog = kind.Precipitation.Value(rain), kind.Fog.Value(fog)


def _pairs(
    before: Sequence[LaneRef], after: Sequence[LaneRef], ids: Mapping[LaneRef, int]
) -> list[tuple[int | None, int | None]]:
    """Return every path through a lane: each pair of a lane before it and a lane after it."""
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
