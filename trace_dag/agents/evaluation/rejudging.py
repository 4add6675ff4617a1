"""The stored drive of an evaluation, and the measures that can be judged again from it without the agent.

A drive has the position (x, y, z, m) and heading (rad) of all parties :data:`RATE_HZ` times a second, up to the first
contact. Rounded to centimetres it does not show the effect of a contact, but whether there was one, and the paths and
speeds of all parties.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import fields
from typing import Final

import numpy as np

from trace_dag.agents.evaluation.metrics import Metrics, driven_measures
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.geometry import FloatArray, gaps_m
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.parties import party_of_body
from trace_dag.scenario.cases import Case
from trace_dag.simulation.types import SimulationLog, VehicleLog

RATE_HZ: Final = 20
_TOUCH_M: Final = 0.1  # bodies that overlap by more have touched
_NEAR_M: Final = 0.3  # greatest gap before a contact, beside the distance that closes between two places of a drive
_OF_FIGURES_M: Final = 0.2  # the outline of a person or animal is smaller than its box by as much
_BEGINS_M, _AS_RECORDED_M = 0.1, 0.3  # tolerances of places, at the beginning and of a recorded motion
_HARDEST_MPS2: Final = 1.5 * GRAVITY_MPS2  # tyres of a road vehicle hold 1 g; over _OVER_S places are exact to 0.2 m/s2
_OVER_S: Final = 0.5
_SAME_S, _SAME_MPS = 0.41, 0.5  # tolerances of the times and speeds that are measured again


def drive_of(log: SimulationLog) -> str:
    """Return the drive of a log as JSON: rows of x, y, z and heading by body."""
    contact = log.first_contact
    end_s = log.duration_s if contact is None else contact.time_s
    times = np.arange(0.0, end_s + 1e-9, 1 / RATE_HZ)
    bodies = {}
    for each in log.vehicles:
        heading = np.interp(times, each.time_s, np.unwrap(each.heading_rad))
        places = [np.interp(times, each.time_s, values) for values in (each.x_m, each.y_m, each.z_m)]
        bodies[str(each.number)] = np.column_stack([np.round(places, 2).T, np.round(heading, 3)]).tolist()
    return json.dumps(bodies, separators=(",", ":"))


def problem_of_drive(case: Case, ego: int, metrics: Metrics, traffic: Traffic, drive: str) -> str:
    """Return the contradiction between a run's measures and its drive; empty if there is none."""
    try:
        rows = {int(number): np.array(places, float).reshape(-1, 4) for number, places in json.loads(drive).items()}
        lengths = {len(places) for places in rows.values()}
        sound = set(rows) == set(case.bodies) and len(lengths) == 1 and min(lengths) > 2
        sound = sound and all(np.isfinite(places).all() for places in rows.values())
    except (ValueError, TypeError, AttributeError):
        sound = False
    if not sound:
        return "its drive is not the places of everybody in the crash"
    logs = {number: _log(number, each) for number, each in rows.items()}
    return next(_problems(case, ego, metrics, traffic, logs), "")


def _problems(case: Case, ego: int, metrics: Metrics, traffic: Traffic, logs: dict[int, VehicleLog]) -> Iterator[str]:
    recorded = {each.number: each for each in case.recorded.vehicles}
    for number, log in logs.items():
        if math.hypot(log.x_m[0] - recorded[number].x_m[0], log.y_m[0] - recorded[number].y_m[0]) > _BEGINS_M:
            yield f"body {number} does not begin where the crash has it"
        if traffic is Traffic.RECORDED and party_of_body(number) != ego:
            there = log.time_s < min(case.impact_time_s, log.time_s[-1])
            x, y = (
                np.interp(log.time_s[there], recorded[number].time_s, values)
                for values in (recorded[number].x_m, recorded[number].y_m)
            )
            if np.hypot(log.x_m[there] - x, log.y_m[there] - y).max(initial=0.0) > _AS_RECORDED_M:
                yield f"body {number} does not do as was recorded"
    own = logs[ego]
    every = round(_OVER_S * RATE_HZ)
    changes = np.hypot(*(np.diff(each[::every]) for each in (own.velocity_x_mps, own.velocity_y_mps)))
    if changes.max(initial=0.0) / _OVER_S > _HARDEST_MPS2:
        yield f"its vehicle's velocity changes by {changes.max() / _OVER_S:.0f} m/s2"
    others = [each for number, each in logs.items() if party_of_body(number) != ego]
    gap_m, last_gap_m = _gaps_m(case, own, others) if others else (math.inf, 0.0)
    if not metrics.collided and gap_m < -_TOUCH_M:
        yield "collided is False, but its drive leads through somebody"
    near_m = _NEAR_M + (metrics.closing_speed_mps or 0.0) / RATE_HZ
    if metrics.collided and last_gap_m > near_m and not case.objects and len(logs) == 2:
        yield f"collided is True, but nobody is nearer than {last_gap_m:.1f} m in the end"
    found = driven_measures(case, ego, own, float(own.time_s[-1]))
    for name in ("off_road_s", "over_traffic_mps", *(() if metrics.collided else ("arrived",))):
        tolerance = _SAME_MPS if name == "over_traffic_mps" else _SAME_S
        if abs(found[name] - getattr(metrics, name)) > tolerance:
            yield f"{name} is {getattr(metrics, name)}, of its drive {found[name]}"


def _gaps_m(case: Case, own: VehicleLog, others: list[VehicleLog]) -> tuple[float, float]:
    """Return the least gap between a vehicle and all others (m, negative for overlap), and the last gap."""
    body, places = case.bodies[own.number], (own.x_m, own.y_m, own.heading_rad)
    gaps = [
        gaps_m(
            places,
            (body.length_m, body.width_m),
            (each.x_m, each.y_m, each.heading_rad),
            (case.bodies[each.number].length_m, case.bodies[each.number].width_m),
        )
        + (_OF_FIGURES_M if case.bodies[each.number].is_figure else 0.0)
        for each in others
    ]
    return float(np.min(gaps)), float(np.min(gaps, axis=0)[-1])


def _log(number: int, places: FloatArray) -> VehicleLog:
    x, y, z, heading = places.T
    velocity_x, velocity_y = (np.gradient(each, 1 / RATE_HZ) for each in (x, y))
    motion = {
        "time_s": np.arange(len(places)) / RATE_HZ,
        "x_m": x,
        "y_m": y,
        "z_m": z,
        "heading_rad": heading,
        "speed_mps": velocity_x * np.cos(heading) + velocity_y * np.sin(heading),
        "velocity_x_mps": velocity_x,
        "velocity_y_mps": velocity_y,
        "landmarks_m": np.zeros((len(places), 0)),
    }
    rest = {each.name: np.zeros(len(places)) for each in fields(VehicleLog) if each.name not in motion}
    return VehicleLog(**rest | motion | {"number": number})
