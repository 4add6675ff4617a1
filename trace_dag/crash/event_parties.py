"""Parties struck by a vehicle: the person, and the number of an object, an animal or a train.

No table has the person of an event (``VNUMBER2`` is 9999 or 5555 there). There is only one vehicle that struck each
person (``STR_VEH``), and it need not be the first (in 2023-510304 it is the second). So a person is identified by kind,
if there is only one of that kind, else by ``STR_VEH``. If several remain, and there are as many strikes as persons,
they are assigned in the order of numbers, and marked; otherwise nobody is named. Open questions are sentences.

FARS only reports that a live animal was struck (``SOE`` 11), without species, course or pace. Ridden animals and
conveyances that an animal draws (``SOE`` 49) are not modelled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.parties import UNKNOWN_NON_MOTORIST, EventKind, PartyKind, thing_party, thing_struck
from trace_dag.crash.record import EventRecord, NonMotorist


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


ORDER_OF_IMPACTS: Final = "order_of_strikes"

_KINDS_STRUCK: Final = {
    codes.PEDESTRIAN: PartyKind.PEDESTRIAN,
    codes.CYCLIST: PartyKind.CYCLIST,
    codes.PERSON_ON_CONVEYANCE: PartyKind.CONVEYANCE,
}
_NAMES: Final = {
    PartyKind.PEDESTRIAN: "pedestrian",
    PartyKind.CYCLIST: "cyclist",
    PartyKind.CONVEYANCE: "person on a conveyance",
}


@dataclass(frozen=True)
class EventParties:
    """The events with the parties struck, the ``implied`` values, the contradictions and the open questions."""

    events: tuple[EventRecord, ...]
    implied: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    ambiguities: tuple[str, ...] = ()


def add_event_parties(
    events: Sequence[EventRecord], persons: Sequence[NonMotorist], *, order_known: bool = True
) -> EventParties:
    """Name the second party of every event that strikes a person, an object, an animal or a train.

    Args:
        events: in order, second parties named where they are vehicles.
        persons: in order of their numbers.
        order_known: False if the sequence was put together from those of the vehicles, which leaves open which of
            two vehicles struck somebody first.

    >>> unnamed = [replace(event, party_2=None) for event in pedestrian_record.events]
    >>> add_event_parties(unnamed, pedestrian_record.non_motorists).events[0].party_2  # person 1
    1001
    """
    strikes = [event for event in events if event.kind is EventKind.PERSON_STRUCK]
    found: dict[int, NonMotorist] = {}
    chosen: set[int] = set()
    contradictions: list[str] = []
    ambiguities: list[str] = []
    for event in strikes:
        of_kind = _of_kind(event, persons)
        if not of_kind:
            sentences = contradictions if persons else ambiguities
            sentences.append(f"{_said(event)}, but the report lists no such person")
            continue
        possible = _possible(event, of_kind, strikes)
        alike = [other for other in strikes if (other.code, other.party_1) == (event.code, event.party_1)]
        if len(possible) == 1:
            found[event.number] = possible[0]
        elif len(possible) == len(alike):
            found[event.number] = possible[alike.index(event)]
            chosen.add(event.number)
        if len(possible) > 1:
            numbers = " and ".join(str(person.number) for person in possible)
            order = "; taken in the order of their numbers" if event.number in chosen else ""
            ambiguities.append(f"{_said(event)}, and nothing tells which of persons {numbers}{order}")
    if not order_known and len({event.party_1 for event in strikes}) > 1:
        chosen.update(event.number for event in strikes)
        ambiguities.append("nothing tells in which order the vehicles struck those they struck")
    named = tuple(_named(event, found.get(event.number)) for event in events)
    return EventParties(
        named,
        (ORDER_OF_IMPACTS,) if chosen else (),
        tuple(contradictions),
        tuple(ambiguities),
    )


def _of_kind(event: EventRecord, persons: Sequence[NonMotorist]) -> list[NonMotorist]:
    wanted = _KINDS_STRUCK[event.code]
    return [person for person in persons if person.kind is wanted or person.person_type_code == UNKNOWN_NON_MOTORIST]


def _possible(event: EventRecord, of_kind: list[NonMotorist], strikes: Sequence[EventRecord]) -> list[NonMotorist]:
    """Return the persons that this strike can have hit: those with its vehicle as ``STR_VEH``, or else any."""
    if len(of_kind) == 1:
        return of_kind
    own = [person for person in of_kind if person.striking_vehicle == event.party_1]
    if own:
        return own
    unsaid = [person for person in of_kind if person.striking_vehicle is None]
    alone = all(other.party_1 == event.party_1 for other in strikes if other.code == event.code)
    return unsaid if alone and unsaid else of_kind


def _named(event: EventRecord, person: NonMotorist | None) -> EventRecord:
    if person is not None:
        return replace(event, party_2=person.party, implied=(*event.implied, "party_2"))
    return event if thing_struck(event.code) is None else replace(event, party_2=thing_party(event.number))


def _said(event: EventRecord) -> str:
    subject = "a vehicle" if event.party_1 is None else f"vehicle {event.party_1}"
    return f"event {event.number}: {subject} struck a {_NAMES[_KINDS_STRUCK[event.code]]} (SOE {event.code})"
