"""How fast the embedded simulation is: simulated seconds per second of one core, logging included, and its memory.

    python benchmarks/simulation.py            synthetic crashes of eight kinds, 1,000 runs for the memory
    python benchmarks/simulation.py --runs 50  fewer

Logging means both files of a log as bytes, as the flow stores them. The targets are 200 times real
time per crash of two vehicles, 150 per crash of a vehicle and a person, 100 per crash of five bodies and three objects.
"""

from __future__ import annotations

import argparse
import math
import resource
import statistics
import time
from dataclasses import replace

import numpy as np

from trace_dag.crash.record import VehicleClass
from trace_dag.geometry import Pose
from trace_dag.settings import SimSettings
from trace_dag.sim.anthropometry import person_body
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.log_io import logs_to_files
from trace_dag.sim.surface import Surface
from trace_dag.sim.types import Body, BodyKind, Participant
from trace_dag.states.objects import FixedObject
from trace_dag.states.types import Trajectory

CAR = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.7, 1.85, 1.45, 1500.0)
TRUCK = replace(CAR, vehicle_class=VehicleClass.TRUCK, length_m=8.5, width_m=2.5, height_m=3.2, mass_kg=12000.0)

ADULT, CYCLIST = person_body(BodyKind.PEDESTRIAN), person_body(BodyKind.CYCLIST)


def vehicle(number: int, x_m: float, y_m: float, heading_rad: float, speed_mps: float, body: Body = CAR) -> Participant:
    """A vehicle, or a person, on a straight plan of eight seconds."""
    t = np.arange(0.0, 8.01, 0.1)
    x, y = x_m + speed_mps * t * math.cos(heading_rad), y_m + speed_mps * t * math.sin(heading_rad)
    same = np.zeros_like(t)
    plan = Trajectory(t, x, y, same, same + heading_rad, same + speed_mps)
    return Participant(number, body, Pose(x_m, y_m, heading_rad), speed_mps, plan)


def fixed(number: int, code: int, x_m: float, y_m: float) -> FixedObject:
    """An object by its ``SOE``, along the x axis."""
    return FixedObject.of_kind(code, number=number, event_number=number - 2000, pose=Pose(x_m, y_m, 0.0))


QUEUE = (
    vehicle(1, -100, 0, 0, 25),
    *(vehicle(number, 6.5 * number, 0.3 * (-1) ** number, 0, 0) for number in range(2, 6)),
)
CRASHES: dict[str, tuple[tuple[Participant, ...], tuple[FixedObject, ...]]] = {
    "head-on": ((vehicle(1, -100, 0, 0, 20), vehicle(2, 78, 0.6, math.pi, 15)), ()),
    "angle": ((vehicle(1, 0, -75, math.pi / 2, 15), vehicle(2, -62, 0, 0, 12)), ()),
    "rear-end": ((vehicle(1, -140, 0, 0, 28), vehicle(2, -50, 0.3, 0, 10)), ()),
    "into a truck": ((vehicle(1, -100, 0, 0, 20), vehicle(2, 60, -1.2, math.pi, 12, TRUCK)), ()),
    "pedestrian": ((vehicle(1, -63, 0, 0, 15), vehicle(1001, 0, -5.8, math.pi / 2, 1.4, ADULT)), ()),
    "cyclist": ((vehicle(1, -75, 0, 0, 18), vehicle(1001, -20, 0.2, 0, 5, CYCLIST)), ()),
    "five in a queue": (QUEUE, ()),
    "and three objects": (QUEUE, (fixed(2001, 24, 30, -2.2), fixed(2002, 42, 45, 4), fixed(2003, 30, 55, -1))),
}


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--runs", type=int, default=1000, help="runs for the memory")
    runs = arguments.parse_args().runs
    simulation = EmbeddedSimulation(SimSettings(), Surface(), 0.75)

    def run(participants: tuple[Participant, ...], objects: tuple[FixedObject, ...]) -> float:
        log = simulation.run(participants, time_limit_s=20.0, objects=objects)
        logs_to_files([log])
        return log.duration_s

    for crash in CRASHES.values():
        run(*crash)
    print(f"{'crash':16} {'simulated s':>11} {'ms':>7} {'times real time':>16}")
    for name, crash in CRASHES.items():
        taken = []
        for _ in range(20):
            began = time.process_time()
            simulated_s = run(*crash)
            taken.append(time.process_time() - began)
        middle = statistics.median(taken)
        print(f"{name:16} {simulated_s:11.2f} {1000 * middle:7.1f} {simulated_s / middle:16.0f}")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for i in range(runs):
        run(*list(CRASHES.values())[i % len(CRASHES)])
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"peak memory {before / 1024:.0f} MiB before, {after / 1024:.0f} MiB after {runs} runs in one process")


if __name__ == "__main__":
    main()
