"""Changes to a crash: each vehicle's speed, timing, lateral place and reaction, and the road's friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np


@dataclass(frozen=True)
class Bounds:
    """Bounds of variations; each change is drawn evenly from within.

    ``speed_rel``: largest relative change of all speeds of a vehicle. ``timing_s``: earlier or later. ``lateral_m``: to
    the left or right. ``friction_low``: least friction as a share of the crash's, which is the most. ``reaction_s``:
    longest time before the recorded impact at which a driver, in half of the variations, begins to brake.
    """

    speed_rel: float = 0.15
    timing_s: float = 0.4
    lateral_m: float = 0.4
    friction_low: float = 0.6
    reaction_s: float = 1.2


@dataclass(frozen=True)
class VehiclePerturbation:
    """Changes to one vehicle. ``reaction_s``: time before the recorded impact from which it brakes; 0 for never."""

    number: int
    speed_factor: float
    delay_s: float
    offset_left_m: float
    reaction_s: float


@dataclass(frozen=True)
class Perturbation:
    """Changes of one variation. ``friction_factor`` multiplies the friction of the crash."""

    vehicles: tuple[VehiclePerturbation, ...]
    friction_factor: float


def draw(key: str, numbers: Sequence[int], seed: int, index: int, bounds: Bounds) -> Perturbation:
    """Return the ``index``-th draw for a crash.

    The result depends on these values alone, not on the order of calls.
    """
    digest = sha256(f"{seed}:{key}:{index}".encode()).digest()
    random = np.random.default_rng(int.from_bytes(digest[:16], "big"))
    friction = float(random.uniform(bounds.friction_low, 1.0))
    vehicles = []
    for number in numbers:
        speed, delay, offset, reacts, reaction = random.uniform(size=5).tolist()
        vehicles.append(
            VehiclePerturbation(
                number=number,
                speed_factor=1 + bounds.speed_rel * (2 * speed - 1),
                delay_s=bounds.timing_s * (2 * delay - 1),
                offset_left_m=bounds.lateral_m * (2 * offset - 1),
                reaction_s=bounds.reaction_s * reaction if reacts < 0.5 else 0.0,
            )
        )
    return Perturbation(tuple(vehicles), friction)
