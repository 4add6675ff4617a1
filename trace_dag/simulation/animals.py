"""Sizes and speeds of animals: FARS has neither, nor the species.

Sizes are in the middle of what is published for grown animals: white-tailed deer 53 to 120 cm at the withers and 0.95
to 2.2 m long (Smith, Mammalian Species 388, 1991), American elk 1.3 to 1.5 m and 170 to 330 kg (Feldhamer, Thompson and
Chapman, Wild Mammals of North America, 2nd ed., 2003), cattle by the mean live weight at slaughter in the United States
(some 1,350 lb: USDA, Livestock Slaughter). The values themselves are our choice within these.

Paces follow from the height of the hip: animals of all sizes go from a walk to a trot near a Froude number (v^2 over g
times hip height) of 0.5, and to a gallop between 2 and 3 (Alexander and Jayes, Journal of Zoology 201, 1983). A trot is
taken at the geometric mean of both changes, a walk at half of its upper one, a gallop at twice its lower one. A deer in
flight is faster, up to 17 m/s over a short distance; the speeds of struck deer are unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.animals import Pace, Species
from trace_dag.simulation.body_sizes import PersonSize

SIZES: Final[Mapping[Species, PersonSize]] = {
    Species.DEER: PersonSize(1.60, 0.42, 0.92, 68.0),
    Species.ELK: PersonSize(2.30, 0.62, 1.40, 250.0),
    Species.CATTLE: PersonSize(2.40, 0.72, 1.35, 610.0),
}
"""Length from nose to rump and width (m), height at the withers (m), and mass (kg)."""
HIP: Final = 0.80
"""Height of the hip joint, of that at the withers."""
_TROTS_FROM, _GALLOPS_FROM = 0.5, 2.5
_FROUDE: Final[Mapping[Pace, float]] = {
    Pace.WALKING: _TROTS_FROM / 2,
    Pace.TROTTING: math.sqrt(_TROTS_FROM * _GALLOPS_FROM),
    Pace.GALLOPING: 2 * _GALLOPS_FROM,
}


def animal_speed_mps(species: Species, pace: Pace) -> float:
    """Return the speed of an animal.

    >>> round(animal_speed_mps(Species.DEER, Pace.TROTTING), 2)
    2.84
    """
    return math.sqrt(_FROUDE[pace] * GRAVITY_MPS2 * HIP * SIZES[species].stature_m)
