"""Speeds of people who walk, run and ride: FARS codes no speed of a person.

Sources, and how far each was checked:

* Walking in a crosswalk, adults up to 64: 4.3 ft/s, the mean of some 1,300 people who did not know they were observed
  (Carson, Accident Reconstruction Journal 34(5), 2024). From 65 on: 3.81 ft/s (Gates, Noyce, Bill and Van Ee,
  Transportation Research Record 1982, 2006, n = 326). Both lie between the 15th percentile and the mean of Knoblauch,
  Pietrucha and Nitzburg (TRR 1538, 1996: 15th percentiles 1.25 and 0.97 m/s), and above the 3.5 ft/s (1.07 m/s) to
  which the MUTCD times signals so that nearly everybody is across.
* Away from a crosswalk people walk 20 % faster than such studies say (Attalla and Kodsi, SAE 2013-01-0772, n = 304).
* Riding: 17.8 km/h, conventional bicycles in urban traffic (Twisk, Stelling et al., SWOV, naturalistic study).
* Animals: :mod:`trace_dag.simulation.animals`.
* Running: NOT read from a table. Vaughan and Bain (SAE 1999-01-0440, 2000-01-0845) measured children and youths, whose
  numbers were not at hand; 3.5 m/s is a jog to an easy run, 2.5 m/s what is taken for people over 64.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from trace_dag.common.units import METRES_PER_FOOT, kmh_to_mps
from trace_dag.crash.animals import StruckAnimal
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import NonMotorist
from trace_dag.crash.zones import is_in_crosswalk
from trace_dag.simulation.animals import animal_speed_mps

OLD_YEARS: Final = 65
_WALKING_MPS: Final = 4.3 * METRES_PER_FOOT
_WALKING_OLD_MPS: Final = 3.81 * METRES_PER_FOOT
_AWAY_FROM_CROSSWALK: Final = 1.2
_RUNNING_MPS: Final = 3.5
_RUNNING_OLD_MPS: Final = 2.5
_RIDING_MPS: Final = kmh_to_mps(17.8)
_ROLLING_MPS: Final = 3.0  # on a skateboard or kick scooter; between walking and riding, judgement
_JOGGING: Final = 4  # NMACTION
_DASHED: Final = frozenset({1, 11})  # NMCC: darted or dashed out
_DASHES: Final = frozenset({741, 742})  # PEDCTYPE
_DASH_GROUP: Final = 740  # PEDCGP


class Gait(StrEnum):
    """Gaits of a person or an animal."""

    STANDING = "standing"
    WALKING = "walking"
    RUNNING = "running"
    RIDING = "riding"
    TROTTING = "trotting"  # from here on: animals
    GALLOPING = "galloping"


def gait_of(person: NonMotorist) -> Gait:
    """Return the gait: running if the report says so, riding if the person rode something, else walking.

    >>> gait_of(pedestrian_record.non_motorists[0]).value  # PEDCTYPE 760: failed to yield, no dash
    'walking'
    """
    if isinstance(person, StruckAnimal):
        return Gait(person.pace)
    if person.kind in (PartyKind.CYCLIST, PartyKind.CONVEYANCE):
        return Gait.RIDING
    return Gait.RUNNING if dashes(person) or _JOGGING in person.actions else Gait.WALKING


def dashes(person: NonMotorist) -> bool:
    """Return whether the person ran out into the road."""
    by_type = person.pedestrian_type_code in _DASHES or person.pedestrian_group_code == _DASH_GROUP
    return by_type or not _DASHED.isdisjoint(person.circumstances)


def usual_speed_mps(person: NonMotorist, gait: Gait) -> float:
    """Return the usual speed of a person of that age (years) with that gait, m/s.

    >>> usual_speed_mps(pedestrian_record.non_motorists[0], Gait.STANDING)
    0.0
    """
    if isinstance(person, StruckAnimal):
        return animal_speed_mps(person.species, person.pace)
    old = person.age_years is not None and person.age_years >= OLD_YEARS
    if gait is Gait.STANDING:
        return 0.0
    if gait is Gait.RUNNING:
        return _RUNNING_OLD_MPS if old else _RUNNING_MPS
    if gait is Gait.RIDING:
        return _RIDING_MPS if person.kind is PartyKind.CYCLIST else _ROLLING_MPS
    return (_WALKING_OLD_MPS if old else _WALKING_MPS) * (1.0 if is_in_crosswalk(person) else _AWAY_FROM_CROSSWALK)
