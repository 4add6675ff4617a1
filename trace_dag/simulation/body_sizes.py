"""Body sizes of people and their mounts, from age and sex, and sizes and speeds of animals.

Stature and mass are the middle of the population: children by the 50th percentile of the CDC growth charts (Kuczmarski
et al., Vital and Health Statistics 11(246), 2002), adults by the means of the National Health and Nutrition Examination
Survey 2011-2014 (Fryar et al., Vital and Health Statistics 3(39), 2016). An unknown sex gives the mean of both, an
unknown age an adult.

FARS has neither sizes nor speeds of animals, nor the species. Sizes are in the middle of what is published for grown
animals: white-tailed deer 53 to 120 cm at the withers and 0.95 to 2.2 m long (Smith, Mammalian Species 388, 1991),
American elk 1.3 to 1.5 m and 170 to 330 kg (Feldhamer, Thompson and Chapman, Wild Mammals of North America, 2nd ed.,
2003), cattle by the mean live weight at slaughter in the United States (some 1,350 lb: USDA, Livestock Slaughter). The
values themselves are our choice within these.

Paces follow from the height of the hip: animals of all sizes go from a walk to a trot near a Froude number (v^2 over g
times hip height) of 0.5, and to a gallop between 2 and 3 (Alexander and Jayes, Journal of Zoology 201, 1983). A trot is
taken at the geometric mean of both changes, a walk at half of its upper one, a gallop at twice its lower one. A deer in
flight is faster, up to 17 m/s over a short distance; the speeds of struck deer are unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.event_parties import Pace, Species
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import Body, BodyKind

_AGES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20)
_MALE_STATURE_CM = (
    *(76.0, 86.5, 95.0, 102.2, 109.0, 115.5, 121.9, 128.0, 133.5, 138.6, 143.5, 149.1, 156.2),
    *(163.8, 170.1, 173.6, 175.3, 175.7, 175.7),
)
_FEMALE_STATURE_CM = (
    *(74.0, 85.0, 94.0, 101.0, 107.9, 115.0, 121.5, 127.5, 133.0, 138.2, 144.0, 151.2, 157.0),
    *(160.4, 161.8, 161.8, 161.8, 161.8, 161.8),
)
_MALE_MASS_KG = (
    *(10.3, 12.7, 14.4, 16.3, 18.5, 20.7, 23.1, 25.6, 28.6, 32.1, 36.1, 40.7, 45.8),
    *(51.2, 56.5, 61.1, 64.7, 67.3, 88.8),
)
_FEMALE_MASS_KG = (
    *(9.5, 12.1, 13.9, 15.9, 18.0, 20.3, 22.9, 25.8, 29.1, 33.0, 37.1, 41.8, 46.1),
    *(49.4, 52.0, 53.9, 55.2, 56.2, 76.4),
)
_ADULT_YEARS = 35.0
_WIDTH = 0.29  # of the stature: across the shoulders with the arms (Drillis and Contini, 1966)
_STRIDE = 0.34  # of the stature: from the heel behind to the toe in front, in the middle of a step
BICYCLE_LENGTH_M, BICYCLE_WIDTH_M, BICYCLE_KG = 1.75, 0.60, 15.0
"""Size of an adult's bicycle; a child's is smaller as the child is, and lighter as its length."""
CONVEYANCE_LENGTH_M, CONVEYANCE_KG = 0.9, 8.0
"""Size of a kick scooter or a board, the most usual personal conveyances."""


@dataclass(frozen=True)
class PersonSize:
    """Length and width of the outline until the person is touched, stature (m), and mass (kg) with the mount."""

    length_m: float
    width_m: float
    stature_m: float
    mass_kg: float


def person_size(kind: PartyKind, age_years: float | None = None, *, female: bool | None = None) -> PersonSize:
    """Return the size of a person of an age (years) and sex, with the mount."""
    years = _ADULT_YEARS if age_years is None else age_years
    share = 0.5 if female is None else float(female)

    def middle(male: tuple[float, ...], women: tuple[float, ...]) -> float:
        return float((1 - share) * np.interp(years, _AGES, male) + share * np.interp(years, _AGES, women))

    stature_m = middle(_MALE_STATURE_CM, _FEMALE_STATURE_CM) / 100
    mass_kg = middle(_MALE_MASS_KG, _FEMALE_MASS_KG)
    if kind is PartyKind.CYCLIST:
        size = min(1.0, stature_m / 1.6)
        return PersonSize(BICYCLE_LENGTH_M * size, BICYCLE_WIDTH_M * size, stature_m, mass_kg + BICYCLE_KG * size)
    if kind is PartyKind.CONVEYANCE:
        return PersonSize(CONVEYANCE_LENGTH_M, _WIDTH * stature_m, stature_m, mass_kg + CONVEYANCE_KG)
    return PersonSize(_STRIDE * stature_m, _WIDTH * stature_m, stature_m, mass_kg)


def person_body(kind: BodyKind, age_years: float | None = None, *, female: bool | None = None) -> Body:
    """Return the body of a person of an age (years) and sex, with the mount.

    ``height_m`` is the stature, ``mass_kg`` that of the person with the bicycle or conveyance; length and width are
    those of the outline on the road until the person is touched.
    """
    size = person_size(PartyKind(kind), age_years, female=female)
    return Body(kind, VehicleClass.OTHER, size.length_m, size.width_m, size.stature_m, size.mass_kg)


def ridden_kg(body: Body) -> float:
    """Return the mass of a person's mount, which is part of the body's mass, at most half.

    >>> ridden_kg(Body(BodyKind.CYCLIST, VehicleClass.OTHER, 1.75, 0.6, 1.75, 90.0))  # a bicycle for adults
    15.0
    """
    if body.kind is BodyKind.CYCLIST:
        return min(BICYCLE_KG * body.length_m / BICYCLE_LENGTH_M, body.mass_kg / 2)
    if body.kind is BodyKind.CONVEYANCE:
        return min(CONVEYANCE_KG, body.mass_kg / 2)
    return 0.0


def animal_speed_mps(species: Species, pace: Pace) -> float:
    """Return the speed of an animal.

    >>> round(animal_speed_mps(Species.DEER, Pace.TROTTING), 2)
    2.84
    """
    return math.sqrt(_FROUDE[pace] * GRAVITY_MPS2 * HIP * SIZES[species].stature_m)


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
