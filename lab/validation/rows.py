"""Rows of a measured crash: one for each vehicle, with its recorder's values and the simulated ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from lab.validation.recorded import Damage, RecordedVehicle, Recording
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import mps_to_kmh
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import PULSE_S, Participant, SimulationLog
from trace_dag.simulation.vehicles import vehicle_model
from trace_dag.verdict.observation import LEAST_RECORDED_MPS

_PULLED: Final = 0.5  # of a delta-v: more cannot come of friction along the side
_STAYS: Final = 0.85  # of dynamic crush, in NHTSA's frontal barrier tests
_AFTER_PULSE_S: Final = 0.03
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
        """Return the row that ``python -m lab validate_simulator --json`` prints."""
        return {
            "case": self.case,
            "vehicle": self.vehicle,
            "measured_delta_v_kmh": _rounded(self.measured_delta_v_kmh),
            "simulated_delta_v_kmh": _rounded(self.simulated_delta_v_kmh),
            "plastic_delta_v_kmh": _rounded(self.plastic_delta_v_kmh),
            "reason": self.reason,
            "kind": self.kind or None,
            "measured_direction_deg": _rounded(self.measured_direction_deg),
            "simulated_direction_deg": _rounded(self.simulated_direction_deg),
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


class Unusable(Exception):  # noqa: N818 - no error: data
    """A case that cannot be set up, with the reason."""


def check_recording(vehicle: RecordedVehicle, recording: Recording, outward: Vector) -> None:
    """Raise :class:`Unusable` for a change that no recorder has to record, and for one toward the struck side.

    ``outward`` is where that side faces, ahead and to the left.
    """
    if recording.delta_v_mps < LEAST_RECORDED_MPS:
        raise Unusable(
            f"vehicle {vehicle.number}: its recorded delta-v of {mps_to_kmh(recording.delta_v_mps):.1f} km/h is below "
            "the 8 km/h from which on a recorder has to record"
        )
    pulled_mps = (recording.ahead_mps or 0.0) * outward[0] + (recording.left_mps or 0.0) * outward[1]
    if pulled_mps > _PULLED * recording.delta_v_mps:
        raise Unusable(
            f"vehicle {vehicle.number}: its recorder contradicts its damage: {mps_to_kmh(pulled_mps):.0f} km/h of its "
            "delta-v are toward the side that was struck"
        )


def simulate(
    participants: tuple[Participant, ...], settings: SimSettings, objects: tuple[FixedObject, ...] = ()
) -> SimulationLog:
    """Return a crash on flat, dry ground, logged at every step, until its pulse is over."""
    fine = settings.model_copy(update={"log_step_s": settings.step_s})
    simulation = EmbeddedSimulation(fine, Surface(), settings.friction)
    return simulation.run(participants, time_limit_s=8.0, after_contact_s=PULSE_S + 0.05, objects=objects)


def recorded_by(log: SimulationLog, index: int) -> Vector:
    """Return the values of a recorder in a vehicle, the greatest change of velocity ahead and to the left, m/s.

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


def compared_row(
    case: str, vehicle: RecordedVehicle, event: int, kind: str, plastic: Vector, log: SimulationLog, index: int
) -> Compared:
    """Return the row of a vehicle that could be compared: the one of the log with that ``index``, whose change was
    recorded in that event.

    ``plastic`` is the peer's delta-v ahead and to the left, m/s.
    """
    recording, damage, contact = vehicle.recording(event), vehicle.damage(event), log.first_contact
    assert recording is not None
    assert contact is not None
    simulated, first = recorded_by(log, index), index == 0
    return Compared(
        case=case,
        vehicle=vehicle.number,
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
    """Return the parts of a delta-v that the recorder has: some record along the vehicle alone, or across it."""
    ahead, left = delta_v
    return math.hypot(
        0.0 if recording.ahead_mps is None else ahead,
        0.0 if recording.left_mps is None else left,
    )


def _measured_direction_deg(recording: Recording, damage: Damage | None) -> float | None:
    """Return the direction of the force: by the recorder, else by the investigators (the CDC's clock or degrees)."""
    if recording.ahead_mps is not None and recording.left_mps is not None:
        return math.degrees(math.atan2(-recording.left_mps, -recording.ahead_mps))
    return None if damage is None or damage.force_from_rad is None else math.degrees(damage.force_from_rad)
