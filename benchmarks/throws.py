"""How far people are thrown, beside Searle's bounds: the share of 360 simulated strikes that lies between them.

    python benchmarks/throws.py             the shares by vehicle
    python benchmarks/throws.py --outside   and every throw that lies outside

Car, van and truck at 10 to 30 m/s; three places along the front; four walking directions; adult and child; the vehicle
brakes at 7 m/s^2 from the strike on. Searle's least and greatest throw of who is launched at a speed v under any
angle are v^2 / (2 mu g) and that times 1 + mu^2 (SAE 831622), with mu 0.66 and the vehicle's speed at the strike.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from itertools import product

import numpy as np

from trace_dag.crash.record import VehicleClass
from trace_dag.geometry import Pose
from trace_dag.settings import SimSettings
from trace_dag.sim.anthropometry import person_body
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.surface import Surface
from trace_dag.sim.types import Body, BodyKind, Participant, SimulationLog
from trace_dag.states.types import Trajectory
from trace_dag.verdict.throws import throw_bounds_m

CAR = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.7, 1.85, 1.45, 1500.0)
VEHICLES = {
    "car": CAR,
    "van": replace(CAR, vehicle_class=VehicleClass.VAN, length_m=5.1, width_m=2.0, height_m=1.9, mass_kg=2200.0),
    "truck": replace(CAR, vehicle_class=VehicleClass.TRUCK, length_m=8.5, width_m=2.5, height_m=3.2, mass_kg=12000.0),
}
PEOPLE = {"adult": person_body(BodyKind.PEDESTRIAN, 35), "child": person_body(BodyKind.PEDESTRIAN, 7)}
SPEEDS_MPS, OFFSETS_M, WALKS_DEG = (10.0, 15.0, 20.0, 25.0, 30.0), (-0.5, 0.0, 0.5), (0, 90, 180, 270)
WALKS_MPS, BRAKES_MPS2, LEAD_S, FRICTION = 1.4, 7.0, 1.0, 0.66


def struck(vehicle: Body, person: Body, speed_mps: float, walks_rad: float, offset_m: float) -> SimulationLog:
    """The log of a vehicle that drives along the x axis and meets a person after a second."""
    t = np.arange(0.0, 12.01, 0.05)
    braked_s = np.clip(t - LEAD_S, 0.0, speed_mps / BRAKES_MPS2)
    speed = speed_mps - BRAKES_MPS2 * braked_s
    start_m = -speed_mps * LEAD_S - vehicle.length_m / 2 - 0.3
    x = start_m + speed_mps * np.minimum(t, LEAD_S + braked_s) - BRAKES_MPS2 * braked_s**2 / 2
    same = np.zeros_like(t)
    drives = Participant(1, vehicle, Pose(start_m, 0.0, 0.0), speed_mps, Trajectory(t, x, same, same, same, speed))
    c, s = math.cos(walks_rad), math.sin(walks_rad)
    along = WALKS_MPS * (t - LEAD_S)
    path = Trajectory(t, along * c, offset_m + along * s, same, same + walks_rad, same + WALKS_MPS)
    begins = Pose(float(path.x_m[0]), float(path.y_m[0]), walks_rad)
    walks = Participant(1001, person, begins, WALKS_MPS, path)
    settings = SimSettings(person_friction=FRICTION)
    return EmbeddedSimulation(settings, Surface(), settings.friction).run((drives, walks), time_limit_s=30.0)


def main() -> None:
    """Print the shares."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--outside", action="store_true", help="print every throw outside the bounds")
    tells = arguments.parse_args().outside
    inside: dict[str, list[bool]] = {}
    for vehicle, who, speed_mps, degrees, offset_m in product(VEHICLES, PEOPLE, SPEEDS_MPS, WALKS_DEG, OFFSETS_M):
        log = struck(VEHICLES[vehicle], PEOPLE[who], speed_mps, math.radians(degrees), offset_m)
        contact = log.contacts[0]
        person = next(each for each in log.vehicles if each.number == 1001)
        thrown_m = math.hypot(person.x_m[-1] - contact.pose_2.x_m, person.y_m[-1] - contact.pose_2.y_m)
        least_m, most_m = throw_bounds_m(math.hypot(*contact.velocity_1_mps), FRICTION)
        within = least_m <= thrown_m <= most_m
        inside.setdefault(vehicle, []).append(within)
        if tells and not within:
            print(f"{vehicle} {speed_mps:.0f} m/s {who} {degrees} deg {offset_m:+.1f} m: {thrown_m / least_m:.2f}")
    for vehicle, each in inside.items():
        print(f"{vehicle:6} {sum(each):4} of {len(each)}: {100 * sum(each) / len(each):.1f} %")
    every = [within for each in inside.values() for within in each]
    print(f"{'all':6} {sum(every):4} of {len(every)}: {100 * sum(every) / len(every):.1f} %")


if __name__ == "__main__":
    main()
