"""The animal of a crash.

FARS only reports that a live animal was struck (``SOE`` 11), without species, course or pace.

Ridden animals and conveyances that an animal draws (``SOE`` 49) do not belong here: they are not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from trace_dag.crash.parties import PartyKind, thing_party
from trace_dag.crash.record import NonMotorist


class Species(StrEnum):
    """Assumed kinds of animals.

    In 147 fatal crashes with animals of 2000 to 2002 whose police reports were read, 113 were with deer and 13 with
    cattle (Williams and Wells, Traffic Injury Prevention 6(1), 2005)."""

    DEER = "deer"
    ELK = "elk"
    CATTLE = "cattle"


class Pace(StrEnum):
    """Assumed movements of animals."""

    WALKING = "walking"
    TROTTING = "trotting"
    GALLOPING = "galloping"


@dataclass(frozen=True)
class StruckAnimal(NonMotorist):
    """An animal that a vehicle struck, in place of the person of other strikes.

    The report has no details of this party, so every code is None. ``number`` is that of the event. Its kind and
    movement are assumptions, see the settings.
    """

    person_type_code: int = 0
    species: Species = Species.DEER
    pace: Pace = Pace.TROTTING

    @property
    def party(self) -> int:
        """Return the party number."""
        return thing_party(self.number)

    @property
    def kind(self) -> PartyKind:
        """Return its kind as a party."""
        return PartyKind.ANIMAL
