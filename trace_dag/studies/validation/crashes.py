"""Each measured crash in the simulator: what its vehicles' recorders would have said, beside what they did say.

Three kinds. *Both*: both vehicles have a recorded delta-v and speed, nothing is free. *One*: one has; the other's speed
is fitted to the delta-v that the case's investigators reconstructed from crush, for the simulator and for the plastic
peer alike. *Object*: a vehicle that struck a tree or a pole at its recorded speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.geometry import Pose
from trace_dag.settings import SimSettings
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.surface import Surface
from trace_dag.sim.types import PULSE_S, Body, Participant, SimulationLog
from trace_dag.sim.vehicles import vehicle_model
from trace_dag.states.objects import KINDS, FixedObject
from trace_dag.studies.validation.placing import before_object, damaged_m, meeting
from trace_dag.studies.validation.plastic import in_body, plastic_delta_v
from trace_dag.studies.validation.recorded import Damage, RecordedCrash, RecordedEvent, RecordedVehicle, Recording
from trace_dag.units import kmh_to_mps, mps_to_kmh

_TREE, _POLE, _SIGN = 42, 30, 59  # SOE
POLES: Final = {  # CIREN's object codes: diameter (m), and the kind of object it is in a simulation
    41: (0.10, _SIGN),
    42: (0.40, _TREE),
    45: (0.15, _SIGN),
    46: (0.30, _TREE),
    50: (0.10, _SIGN),
    51: (0.20, _POLE),
    52: (0.40, _POLE),
    53: (0.20, _POLE),
}
_LEAST_MPS: Final = kmh_to_mps(8.0)  # from which on a recorder has to record: 49 CFR 563.5
_CONTRADICTION: Final = 2.0
_FASTEST_MPS: Final = kmh_to_mps(200.0)
_STAYS: Final = 0.85  # of dynamic crush, in NHTSA's frontal barrier tests
_TRIED: Final = 9
_REFINED: Final = 12
_AFTER_PULSE_S: Final = 0.03
_SIDEWAYS_RAD: Final = math.radians(40.0)
Vector = tuple[float, float]


@dataclass(frozen=True)
class Compared:
    """A vehicle of a case: what was measured, and what simulator and peer say of the same parts (km/h); with
    ``reason`` none of them. Directions are those that the force came from, degrees counter-clockwise from the front."""

    case: str
    vehicle: int | None
    kind: str  # both, one, object
    measured_delta_v_kmh: float | None = None
    simulated_delta_v_kmh: float | None = None
    plastic_delta_v_kmh: float | None = None
    measured_direction_deg: float | None = None
    simulated_direction_deg: float | None = None
    measured_crush_m: float | None = None
    simulated_crush_m: float | None = None
    pulse_s: float | None = None
    first: bool = True  # the vehicle that the event names first
    reason: str | None = None

    def published(self) -> dict[str, str | int | float | None]:
        """What ``trace-dag validate --json`` prints of it."""
        return {
            "case": self.case,
            "vehicle": self.vehicle,
            "measured_delta_v_kmh": _rounded(self.measured_delta_v_kmh),
            "simulated_delta_v_kmh": _rounded(self.simulated_delta_v_kmh),
            "plastic_delta_v_kmh": _rounded(self.plastic_delta_v_kmh),
            "reason": self.reason,
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


class _Unusable(Exception):  # noqa: N818 - no error: data
    """Why a case cannot be set up."""


def compare_crashes(crashes: Iterable[RecordedCrash], settings: SimSettings) -> list[Compared]:
    """Every vehicle of every case, in the order of the file."""
    return [row for crash in crashes for row in compare_crash(crash, settings)]


def compare_crash(crash: RecordedCrash, settings: SimSettings) -> list[Compared]:
    """The vehicles of a case; with a reason those that cannot be compared."""
    rows: dict[int | None, Compared] = {}
    try:
        rows = {row.vehicle: row for row in _compared(crash, settings)}
        reason = "was not in the event that is compared"
    except _Unusable as unusable:
        reason = str(unusable)
    numbers: list[int | None] = [*crash.vehicles] or [None]
    return [rows.get(number) or Compared(crash.case, number, "", reason=reason) for number in numbers]


def _compared(crash: RecordedCrash, settings: SimSettings) -> Iterator[Compared]:
    event = _event_of_two(crash)
    if event is not None:
        assert event.other_vehicle is not None
        pair = crash.vehicles[event.vehicle], crash.vehicles[event.other_vehicle]
        return _compare_two(crash.case, event, pair, settings)
    for event in crash.events:
        vehicle = crash.vehicles.get(event.vehicle)
        if event.object_code in POLES and vehicle is not None and vehicle.recording(event.number) is not None:
            return iter([_compare_object(crash.case, event, vehicle, settings)])
    raise _Unusable("no recorder has a delta-v of an event of two vehicles, or of one into a tree or pole")


def _event_of_two(crash: RecordedCrash) -> RecordedEvent | None:
    """The first event of two vehicles that as many recorders as possible have a delta-v of."""
    best: tuple[int, RecordedEvent] | None = None
    for event in crash.events:
        pair = [crash.vehicles.get(number) for number in (event.vehicle, event.other_vehicle or 0)]
        if any(vehicle is None for vehicle in pair):
            continue
        recorded = sum(vehicle is not None and vehicle.recording(event.number) is not None for vehicle in pair)
        if recorded > (best[0] if best else 0):
            best = recorded, event
    return best[1] if best else None


# --- two vehicles ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Pair:
    """Two vehicles ready to be simulated at any speeds."""

    bodies: tuple[Body, Body]
    headings_rad: tuple[float, float]
    damaged: tuple[Vector, Vector]

    def velocities(self, speeds_mps: tuple[float, float]) -> tuple[Vector, Vector]:
        one, two = (
            (speed * math.cos(heading), speed * math.sin(heading))
            for speed, heading in zip(speeds_mps, self.headings_rad, strict=True)
        )
        return one, two

    def plastic(self, speeds_mps: tuple[float, float]) -> tuple[Vector, Vector]:
        """Delta-v of both, each ahead and to the left."""
        changes = plastic_delta_v((self.bodies[0].mass_kg, self.bodies[1].mass_kg), *self.velocities(speeds_mps))
        one, two = (in_body(change, heading) for change, heading in zip(changes, self.headings_rad, strict=True))
        return one, two

    def simulated(self, speeds_mps: tuple[float, float], settings: SimSettings) -> SimulationLog | None:
        """The crash; None if they never meet."""
        placed = meeting(self.bodies, self.headings_rad, speeds_mps, self.damaged)
        if placed is None:
            return None
        log = simulate(placed, settings)
        return log if log.first_contact is not None else None


def simulate(
    participants: tuple[Participant, ...], settings: SimSettings, objects: tuple[FixedObject, ...] = ()
) -> SimulationLog:
    """A crash on flat, dry ground, logged at every step, until its pulse is over."""
    fine = settings.model_copy(update={"log_step_s": settings.step_s})
    simulation = EmbeddedSimulation(fine, Surface(), settings.friction)
    return simulation.run(participants, time_limit_s=8.0, after_contact_s=PULSE_S + 0.05, objects=objects)


def recorded_by(log: SimulationLog, index: int) -> Vector:
    """What a recorder in a vehicle would say, the greatest change of velocity ahead and to the left, m/s.

    It adds up the accelerations along the vehicle's own axes from the first touch on, until the pulse is over and 30 ms
    more, for a quarter of a second at most (49 CFR 563.5).
    """
    contact, vehicle = log.first_contact, log.vehicles[index]
    assert contact is not None
    ahead_m = vehicle_model(log.bodies[vehicle.number]).cg_ahead_m
    c, s = np.cos(vehicle.heading_rad), np.sin(vehicle.heading_rad)
    vx = vehicle.velocity_x_mps - ahead_m * vehicle.yaw_rate_rps * s
    vy = vehicle.velocity_y_mps + ahead_m * vehicle.yaw_rate_rps * c
    until_s = contact.time_s + min(PULSE_S, contact.duration_s + _AFTER_PULSE_S)
    first, last = np.searchsorted(vehicle.time_s, (contact.time_s, until_s))
    use = slice(max(int(first) - 1, 0), int(last) + 1)
    middle = (vehicle.heading_rad[use][1:] + vehicle.heading_rad[use][:-1]) / 2
    step_x, step_y = np.diff(vx[use]), np.diff(vy[use])
    ahead = np.cumsum(step_x * np.cos(middle) + step_y * np.sin(middle))
    left = np.cumsum(step_y * np.cos(middle) - step_x * np.sin(middle))
    return float(ahead[np.abs(ahead).argmax()]), float(left[np.abs(left).argmax()])


def _compare_two(
    case: str, event: RecordedEvent, pair: tuple[RecordedVehicle, RecordedVehicle], settings: SimSettings
) -> Iterator[Compared]:
    ready = _ready(event, pair)
    recordings = tuple(vehicle.recording(event.number) for vehicle in pair)
    both = all(recording is not None for recording in recordings)
    if both:
        _check_momentum(ready, recordings)
    for vehicle, recording in zip(pair, recordings, strict=True):
        if recording is not None:
            _check_recording(vehicle, recording)
    known = [recording.speed_mps if recording is not None else None for recording in recordings]
    speeds = peer_speeds = (known[0] or 0.0, known[1] or 0.0)
    if None in known:
        if known == [None, None]:
            raise _Unusable("no recorder has a speed before the impact")
        free = known.index(None)
        target = _target(pair, event.number, free)
        speeds = _fitted(lambda s: _simulated_delta_v(ready, s, settings, target[0]), known, free, target[1])
        peer_speeds = _fitted(lambda s: math.hypot(*ready.plastic(s)[target[0]]), known, free, target[1])
    log = ready.simulated(speeds, settings)
    if log is None:
        raise _Unusable("placed by their damage and at these speeds the two never meet")
    plastic = ready.plastic(peer_speeds)
    for index, (vehicle, recording) in enumerate(zip(pair, recordings, strict=True)):
        if recording is None:
            yield Compared(
                case, vehicle.number, "one", reason=f"vehicle {vehicle.number} has no recorded delta-v of this event"
            )
            continue
        damage = vehicle.damage(event.number)
        kind = "both" if both and None not in known else "one"
        yield _row(
            case, vehicle.number, kind, recording, damage, recorded_by(log, index), plastic[index], log, index == 0
        )


def _ready(event: RecordedEvent, pair: tuple[RecordedVehicle, RecordedVehicle]) -> _Pair:
    bodies, headings, damaged = [], [], []
    for vehicle, area in zip(pair, (event.area, event.other_area), strict=True):
        if vehicle.body is None:
            raise _Unusable(f"vehicle {vehicle.number}: its mass is not known")
        if vehicle.heading_rad is None:
            raise _Unusable(f"vehicle {vehicle.number}: its heading at the impact is not known")
        place = damaged_m(vehicle, vehicle.body, vehicle.damage(event.number), area)
        if place is None:
            raise _Unusable(f"vehicle {vehicle.number}: struck at {area!r}, which is not a side of a vehicle")
        bodies.append(vehicle.body)
        headings.append(vehicle.heading_rad)
        damaged.append(place)
    return _Pair((bodies[0], bodies[1]), (headings[0], headings[1]), (damaged[0], damaged[1]))


def _check_recording(vehicle: RecordedVehicle, recording: Recording) -> None:
    if recording.delta_v_mps < _LEAST_MPS:
        raise _Unusable(
            f"vehicle {vehicle.number}: its recorded delta-v of {mps_to_kmh(recording.delta_v_mps):.1f} km/h is below "
            "the 8 km/h from which on a recorder has to record"
        )


def _check_momentum(ready: _Pair, recordings: tuple[Recording | None, ...]) -> None:
    """Both felt the same impulse: of what both recorded, neither may be a multiple of the other."""
    felt = []
    for body, recording in zip(ready.bodies, recordings, strict=True):
        assert recording is not None
        felt.append((body.mass_kg * recording.delta_v_mps, recording.left_mps is not None))
    for (own, whole), (other, _) in ((felt[0], felt[1]), (felt[1], felt[0])):
        if whole and other > _CONTRADICTION * own:
            raise _Unusable(
                f"the recorders contradict each other: impulses of {felt[0][0] / 1000:.0f} and "
                f"{felt[1][0] / 1000:.0f} kNs by mass and delta-v, which ought to be equal"
            )


def _target(pair: tuple[RecordedVehicle, RecordedVehicle], event: int, free: int) -> tuple[int, float]:
    """Whose reconstructed delta-v the free speed is fitted to, and how much it is."""
    for index in (1 - free, free):
        delta_v = pair[index].reconstructed_mps.get(event)
        if delta_v:
            return index, delta_v
    raise _Unusable(
        f"vehicle {pair[free].number}: its speed is not recorded, and no delta-v was reconstructed to fit it to"
    )


def _simulated_delta_v(ready: _Pair, speeds_mps: tuple[float, float], settings: SimSettings, index: int) -> float:
    log = ready.simulated(speeds_mps, settings)
    return math.hypot(*recorded_by(log, index)) if log is not None else 0.0


def _fitted(
    delta_v: Callable[[tuple[float, float]], float], known: list[float | None], free: int, target_mps: float
) -> tuple[float, float]:
    """Speeds of both with the free one such that the delta-v comes nearest to a target: the best of some, refined by
    halving the distance to its neighbours."""

    def speeds(speed_mps: float) -> tuple[float, float]:
        one, two = (speed_mps if index == free else (value or 0.0) for index, value in enumerate(known))
        return one, two

    def miss(speed_mps: float) -> float:
        return abs(delta_v(speeds(speed_mps)) - target_mps)

    apart = _FASTEST_MPS / (_TRIED - 1)
    least, best = min((miss(k * apart), k * apart) for k in range(_TRIED))
    for _ in range(_REFINED):
        apart /= 2
        for near in (best - apart, best + apart):
            if near >= 0.0 and (missed := miss(near)) < least:
                least, best = missed, near
                break
    return speeds(best)


# --- objects ---------------------------------------------------------------------------------------------------
def _compare_object(case: str, event: RecordedEvent, vehicle: RecordedVehicle, settings: SimSettings) -> Compared:
    recording, damage, body = vehicle.recording(event.number), vehicle.damage(event.number), vehicle.body
    assert recording is not None
    assert event.object_code is not None
    if body is None:
        raise _Unusable(f"vehicle {vehicle.number}: its mass is not known")
    if recording.speed_mps is None:
        raise _Unusable(f"vehicle {vehicle.number}: its recorder has no speed before the impact")
    _check_recording(vehicle, recording)
    if recording.delta_v_mps > _CONTRADICTION * recording.speed_mps:
        raise _Unusable(
            f"vehicle {vehicle.number}: its recorder contradicts itself: {mps_to_kmh(recording.speed_mps):.0f} km/h "
            f"before it struck what stands, and a delta-v of {mps_to_kmh(recording.delta_v_mps):.0f} km/h from it"
        )
    place = damaged_m(vehicle, body, damage, event.area)
    if place is None:
        raise _Unusable(f"vehicle {vehicle.number}: struck at {event.area!r}, which is not a side of a vehicle")
    diameter_m, kind = POLES[event.object_code]
    on_side = damage is not None and damage.side in "LR"
    force_rad = damage.force_from_rad if damage is not None and damage.force_from_rad is not None else 0.0
    course = force_rad if on_side or abs(force_rad) > _SIDEWAYS_RAD else 0.0
    start = before_object(body, place, course, recording.speed_mps, diameter_m / 2)
    log = simulate((start,), settings, (_post(kind, diameter_m),))
    if log.first_contact is None:
        raise _Unusable("placed by its damage and at this speed the vehicle does not meet the object")
    speed = recording.speed_mps
    stops = (-speed * math.cos(course), -speed * math.sin(course))
    return _row(case, vehicle.number, "object", recording, damage, recorded_by(log, 0), stops, log, first=True)


def _post(code: int, diameter_m: float) -> FixedObject:
    kind = KINDS[code]
    return FixedObject(
        number=2001,
        event_number=1,
        code=code,
        name=kind.name,
        pose=Pose(0.0, 0.0, 0.0),
        length_m=diameter_m,
        width_m=diameter_m,
        height_m=kind.height_m,
        resistance=kind.resistance,
        force_n=kind.force_n,
        energy_j=kind.energy_j,
    )


# --- rows ------------------------------------------------------------------------------------------------------
def _row(
    case: str,
    vehicle: int,
    kind: str,
    recording: Recording,
    damage: Damage | None,
    simulated: Vector,
    plastic: Vector,
    log: SimulationLog,
    first: bool,
) -> Compared:
    contact = log.first_contact
    assert contact is not None
    return Compared(
        case=case,
        vehicle=vehicle,
        kind=kind,
        measured_delta_v_kmh=mps_to_kmh(recording.delta_v_mps),
        simulated_delta_v_kmh=mps_to_kmh(_same_parts(simulated, recording)),
        plastic_delta_v_kmh=mps_to_kmh(_same_parts(plastic, recording)),
        measured_direction_deg=_measured_direction_deg(recording, damage),
        simulated_direction_deg=math.degrees(math.atan2(-simulated[1], -simulated[0])),
        measured_crush_m=damage.crush_m if damage is not None else None,
        simulated_crush_m=_STAYS * (contact.crush_1_m if first else contact.crush_2_m),
        pulse_s=contact.duration_s,
        first=first,
    )


def _same_parts(delta_v: Vector, recording: Recording) -> float:
    """Of a delta-v what the recorder has of it: some record along the vehicle alone."""
    return abs(delta_v[0]) if recording.left_mps is None else math.hypot(*delta_v)


def _measured_direction_deg(recording: Recording, damage: Damage | None) -> float | None:
    """Where the force came from: by the recorder, else by the investigators (the CDC's clock or degrees)."""
    if recording.left_mps is not None:
        return math.degrees(math.atan2(-recording.left_mps, -recording.ahead_mps))
    return None if damage is None or damage.force_from_rad is None else math.degrees(damage.force_from_rad)
