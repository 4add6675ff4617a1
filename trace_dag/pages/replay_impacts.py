"""Data to reproduce the strike of a person in simulators whose walkers do not collide: trigger, path, impact point.

CARLA's walkers do not collide physically: a vehicle passes through them or stops at them, and nobody is thrown. A test
uses these numbers to decide when a person sets off and whether the vehicle struck the person.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from trace_dag.crash.parties import party_label

if TYPE_CHECKING:
    from trace_dag.common.geometry import Pose
    from trace_dag.simulation.types import Contact, SimulationLog, VehicleLog


def strikes(log: SimulationLog) -> list[dict[str, object]]:
    """Return the first strike of each person by each vehicle, in order, in the frame of the log.

    Empty if nobody was struck.

    ``trigger`` is the state of the striking vehicle when the person sets off; ``path`` the person's motion up to the
    first strike, rows of time (s), x, y, z (m), heading (rad) and speed (m/s).

    >>> strikes(log)  # nobody on foot was struck
    []
    """
    found: dict[tuple[int, int], Contact] = {}
    for contact in sorted(log.contacts, key=lambda each: each.time_s):
        if log.is_figure(contact.number_2):
            found.setdefault((contact.number_1, contact.number_2), contact)
    logged = {each.number: each for each in log.vehicles}
    first_s: dict[int, float] = {}
    for (_, person), contact in found.items():
        first_s.setdefault(person, contact.time_s)
    return [
        _strike(log, logged[vehicle], logged[person], contact, first_s[person])
        for (vehicle, person), contact in found.items()
    ]


def _strike(
    log: SimulationLog, vehicle: VehicleLog, person: VehicleLog, contact: Contact, first_s: float
) -> dict[str, object]:
    before = person.time_s < first_s
    rows = np.stack([person.time_s, person.x_m, person.y_m, person.z_m, person.heading_rad, person.speed_mps], axis=-1)
    walked = rows[before] if before.any() else rows[:1]
    moving = np.flatnonzero(np.abs(walked[:, 5]) > 0.05)
    sets_off = int(moving[0]) if len(moving) else 0
    sets_off_s = float(walked[sets_off, 0])
    driven = (vehicle.time_s >= sets_off_s) & (vehicle.time_s <= contact.time_s)
    way_m = float(np.hypot(np.diff(vehicle.x_m[driven]), np.diff(vehicle.y_m[driven])).sum())
    speeds = [float(np.hypot(*velocity)) for velocity in (contact.velocity_1_mps, contact.velocity_2_mps)]
    return {
        "person": party_label(person.number),
        "kind": str(log.bodies[person.number].kind),
        "vehicle": party_label(vehicle.number),
        "trigger": {
            "person_sets_off_at_s": _short(sets_off_s),
            "time_to_impact_s": _short(contact.time_s - sets_off_s),
            "vehicle_distance_to_impact_m": _short(way_m),
            "vehicle_speed_mps": _short(float(np.interp(sets_off_s, vehicle.time_s, vehicle.speed_mps))),
        },
        "impact": {
            "time_s": _short(contact.time_s),
            "x_m": _short(contact.x_m),
            "y_m": _short(contact.y_m),
            "z_m": _short(contact.z_m),
            "vehicle_pose": _pose(contact.pose_1),
            "person_pose": _pose(contact.pose_2),
            "vehicle_speed_mps": _short(speeds[0]),
            "person_speed_mps": _short(speeds[1]),
        },
        "path": [[_short(value) for value in row] for row in walked.tolist()],
    }


def _pose(pose: Pose) -> list[float]:
    """Return x, y, z (m) and heading (rad)."""
    return [_short(value) for value in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)]


def _short(value: float) -> float:
    return round(value, 4) + 0.0
