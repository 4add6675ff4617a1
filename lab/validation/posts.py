"""A vehicle that struck a tree or a pole, at the speed that its recorder has."""

from __future__ import annotations

import math
from typing import Final

from lab.validation.placing import OUTWARD, before_object, damaged_m, struck_side
from lab.validation.recorded import Damage, RecordedEvent, RecordedVehicle
from lab.validation.rows import Compared, Unusable, check_recording, compared_row, simulate
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import mps_to_kmh
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.obstacles import POLE_TEST_MPS, crush_m
from trace_dag.simulation.types import Body

_TREE, _POLE, _SIGN = 42, 30, 59  # SOE
POSTS: Final = {  # CIREN's object codes: diameter (m), and the kind of object it is in a simulation
    41: (0.10, _SIGN),
    42: (0.40, _TREE),
    45: (0.15, _SIGN),
    46: (0.30, _TREE),
    50: (0.10, _SIGN),
    51: (0.20, _POLE),
    52: (0.40, _POLE),
    53: (0.20, _POLE),
}
_CONTRADICTION: Final = 2.0
_SIDEWAYS_RAD: Final = math.radians(40.0)


def compare_with_post(case: str, event: RecordedEvent, vehicle: RecordedVehicle, settings: SimSettings) -> Compared:
    """Return the vehicle of such an event; :class:`Unusable` where it cannot be."""
    recording, damage, body = vehicle.recording(event.number), vehicle.damage(event.number), vehicle.body
    assert recording is not None
    assert event.object_code is not None
    if body is None:
        raise Unusable(f"vehicle {vehicle.number}: its mass is not known")
    if recording.speed_mps is None:
        raise Unusable(f"vehicle {vehicle.number}: its recorder has no speed before the impact")
    if recording.delta_v_mps > _CONTRADICTION * recording.speed_mps:
        raise Unusable(
            f"vehicle {vehicle.number}: its recorder contradicts itself: {mps_to_kmh(recording.speed_mps):.0f} km/h "
            f"before it struck what stands, and a delta-v of {mps_to_kmh(recording.delta_v_mps):.0f} km/h from it"
        )
    side = struck_side(damage, event.area)
    if side is None:
        raise Unusable(f"vehicle {vehicle.number}: struck at {event.area!r}, which is not a side of a vehicle")
    check_recording(vehicle, recording, OUTWARD[side])
    place = damaged_m(vehicle, body, damage, side)
    diameter_m, kind = POSTS[event.object_code]
    on_side = damage is not None and damage.side in "LR"
    force_rad = damage.force_from_rad if damage is not None and damage.force_from_rad is not None else 0.0
    course = force_rad if on_side or abs(force_rad) > _SIDEWAYS_RAD else 0.0
    locked_wheels = vehicle.locked_wheels(event.number)
    start = before_object(body, place, course, recording.speed_mps, diameter_m / 2, locked_wheels)
    post = _post(kind, diameter_m)
    if post.force_n is not None and damage is not None and _pressing_n(body, damage) > post.force_n:
        post = _post(_TREE, diameter_m)
    log = simulate((start,), settings, (post,))
    if log.first_contact is None:
        raise Unusable("placed by its damage and at this speed the vehicle does not meet the object")
    speed = recording.speed_mps
    stops = (-speed * math.cos(course), -speed * math.sin(course))
    return compared_row(case, vehicle, event.number, "object", stops, log, 0)


def _post(kind: int, diameter_m: float) -> FixedObject:
    pose = Pose(0.0, 0.0, 0.0)
    return FixedObject.of_kind(kind, number=2001, event_number=1, pose=pose, length_m=diameter_m, width_m=diameter_m)


def _pressing_n(body: Body, damage: Damage) -> float:
    """Return the force that a pole pressed a vehicle with, by its largest crush: an object that left a dent of that
    depth held at least as much.
    """
    rate = POLE_TEST_MPS / crush_m(body.vehicle_class)
    return body.mass_kg * rate * rate * (damage.crush_m or 0.0)
