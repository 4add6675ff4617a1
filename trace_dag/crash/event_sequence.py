"""The harmful events of a crash in order, with their parties.

Estimators plan them, simulations show them and verdicts judge them.

It begins with the first harmful event (``HARM_EV``). Events that follow at once between the same two parties belong to
the one before: the two are still in contact, or the vehicle runs over the person it has struck. Tables before 2016
often list no events and no persons; then the object that the only vehicle struck follows from the first harmful event.
Nothing is guessed for several vehicles or persons: an open question rejects the crash.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Final, TypeAlias

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.crash_types import SIDE_AFTER_EVENT, DepartureSide, side_after
from trace_dag.crash.event_parties import ORDER_OF_IMPACTS, StruckAnimal
from trace_dag.crash.parties import UNKNOWN_NON_MOTORIST, EventKind, thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, NonMotorist, VehicleRecord
from trace_dag.crash.summary import event_in_words

ORDER_OF_CONTACTS: Final = "order_of_contacts"
_OBJECTS: Final = codes.FIXED_OBJECTS | codes.LYING_OBJECTS
MODELLED: Final = codes.VEHICLE_CONTACTS | codes.PERSON_EVENTS | _OBJECTS | {codes.LIVE_ANIMAL, codes.OVERTURN}
"""Events (``SOE``) that a simulation can have. Not trains, cargo and what falls or is thrown, ridden animals and what
they draw, who falls from a vehicle, fire, water, and harm without a collision."""
CONTACTS: Final = frozenset({EventKind.VEHICLE_CONTACT, EventKind.PERSON_STRUCK, EventKind.ANIMAL_STRUCK})
"""Kinds of events in which a vehicle touches somebody: a verdict asks for each of them, in order."""
OFF_THE_ROAD: Final = frozenset({EventKind.OBJECT_STRUCK, EventKind.OVERTURN})

_PERSON_TYPE: Final = {codes.PEDESTRIAN: 5, codes.CYCLIST: 6, codes.PERSON_ON_CONVEYANCE: 8}
"""``PER_TYP`` of who was struck in an event with that code."""
_OF_TWO_IN_TRANSPORT: Final = frozenset({codes.MOTOR_VEHICLE_IN_TRANSPORT, codes.VEHICLE_OUTSIDE_TRAFFICWAY})
_MOST_TOLD: Final = 4

Partner: TypeAlias = VehicleRecord | NonMotorist | None


@dataclass(frozen=True)
class CrashEvent:
    """A harmful event that can be simulated.

    ``vehicle`` touches ``partner``: another vehicle, a person or an animal, or None if it strikes an object or
    overturns. ``area`` and ``partner_area`` are the areas in contact, None if unknown. ``side`` is the side on which
    the vehicle left the road before, by the event ``departure``; None if no event reports it. ``going_on`` has the
    numbers of the events that follow at once between the same parties.
    """

    number: int
    code: int
    kind: EventKind
    vehicle: VehicleRecord
    area: ImpactArea | None = None
    partner: Partner = None
    partner_area: ImpactArea | None = None
    side: DepartureSide | None = None
    departure: int | None = None
    going_on: tuple[int, ...] = ()

    @property
    def party(self) -> int:
        """Return the number of the second party; the vehicle's own if it overturns."""
        if self.kind is EventKind.OBJECT_STRUCK:
            return thing_party(self.number)
        if isinstance(self.partner, VehicleRecord):
            return self.partner.number
        return self.vehicle.number if self.partner is None else self.partner.party

    @property
    def pair(self) -> tuple[int, int]:
        """Return the numbers of both parties, the lower one first; an object has 2000 plus the event's number."""
        one, two = sorted((self.vehicle.number, self.party))
        return one, two

    @property
    def is_contact(self) -> bool:
        """Return whether a vehicle touches another one, a person or an animal."""
        return self.kind in CONTACTS

    @property
    def person(self) -> NonMotorist:
        """Return the person that the vehicle strikes.

        Raises ``TypeError`` for an event of another kind.
        """
        if not isinstance(self.partner, NonMotorist):
            raise TypeError(f"event {self.number} is no strike of a person or an animal")
        return self.partner

    @property
    def vehicles(self) -> tuple[VehicleRecord, ...]:
        """Return the vehicles of the event, each with the area of impact in this event."""
        own = replace(self.vehicle, impact=self.area)
        return (
            (own, replace(self.partner, impact=self.partner_area))
            if isinstance(self.partner, VehicleRecord)
            else (own,)
        )

    def as_struck(self, number: int) -> VehicleRecord:
        """Return a vehicle of the event with the area of impact in this event.

        Raises ``KeyError`` for any other vehicle.
        """
        for vehicle in self.vehicles:
            if vehicle.number == number:
                return vehicle
        raise KeyError(number)

    @property
    def parked(self) -> VehicleRecord | None:
        """Return the vehicle that is parked or at work, if one is."""
        return next((vehicle for vehicle in self.vehicles if not vehicle.in_transport), None)

    @property
    def name(self) -> str:
        """Return its name in a hypothesis."""
        what = {EventKind.OBJECT_STRUCK: "object", EventKind.OVERTURN: "overturn"}.get(self.kind, "contact")
        return f"{what} of event {self.number}"


@dataclass(frozen=True)
class EventSequence:
    """The harmful events of a crash that can be simulated, in order, at least one.

    ``not_modelled`` are harmful events that cannot be simulated, ``unclear`` those whose parties are not reported, by
    number with the reason. ``order_known`` is False if the order of the contacts is not reported.
    """

    events: tuple[CrashEvent, ...]
    order_known: bool = True
    not_modelled: tuple[EventRecord, ...] = ()
    unclear: Mapping[int, str] = field(default_factory=dict)

    @property
    def first(self) -> CrashEvent:
        """Return the first harmful event."""
        return self.events[0]

    @property
    def contacts(self) -> tuple[CrashEvent, ...]:
        """Return the contacts of vehicles with vehicles, people or animals."""
        return tuple(event for event in self.events if event.is_contact)

    def has(self, number: int) -> bool:
        """Return whether an event of the report is in the sequence: as an event, as part of one, or as left out."""
        beyond = (event.number for event in self.not_modelled)
        own = (each for event in self.events for each in (event.number, *event.going_on))
        return number in {*own, *beyond, *self.unclear}

    def goes_on_with(self, number: int) -> CrashEvent | None:
        """Return the event that continues in the report's event of this number, or None."""
        return next((event for event in self.events if number in event.going_on), None)


def sequence_of(record: CrashRecord) -> EventSequence:
    """Return the sequence of a crash.

    Raises :class:`Rejection` if a part of it is not reported (``incomplete_sequence``) or cannot be simulated
    (``not_modelled``).

    >>> [(event.kind.value, event.pair) for event in sequence_of(queue_record).events]
    [('vehicle_contact', (1, 2)), ('vehicle_contact', (2, 3))]
    >>> sequence_of(replace(queue_record, vehicles_in_transport=4))
    Traceback (most recent call last):
    trace_dag.common.errors.Rejection: incomplete_sequence: the report lists 3 of 4 vehicles in transport
    """
    from_first = _from_first_harmful(record)
    if from_first[0].code not in MODELLED:
        raise _not_modelled(from_first)
    harmful = (*from_first, *_implied_overturns(record, from_first))
    reader = _Reader(record)
    for event in harmful:
        reader.add(event)
    missing = _missing_from(record, harmful, reader)
    if missing is not None:
        raise _incomplete(missing)
    order_known = not {ORDER_OF_CONTACTS, ORDER_OF_IMPACTS} & set(record.implied)
    beyond = tuple(event for event in harmful if event.code not in MODELLED)
    return EventSequence(tuple(reader.events), order_known, beyond, reader.unclear)


def _incomplete(detail: str) -> Rejection:
    return Rejection(Reason.INCOMPLETE_SEQUENCE, detail)


# --- which events ----------------------------------------------------------------------------------------------------
def _from_first_harmful(record: CrashRecord) -> Sequence[EventRecord]:
    """Return the harmful events from that of ``HARM_EV`` on, or from the first one.

    If the report lists none, return the implied event.
    """
    harmful = [event for event in record.events if event.is_harmful]
    code = record.first_harmful_event_code
    first = next((place for place, event in enumerate(harmful) if event.code == code), 0)
    contradicted = code in codes.VEHICLE_CONTACTS | codes.PERSON_EVENTS and all(event.code != code for event in harmful)
    return _implied(record, code) if contradicted or not harmful else harmful[first:]


def _implied(record: CrashRecord, code: int | None) -> Sequence[EventRecord]:
    """Return the event that ``HARM_EV`` implies if the crash has one vehicle."""
    if (unlisted := unlisted_vehicles(record)) is not None:
        raise _incomplete(unlisted)
    moving = [vehicle for vehicle in record.vehicles if vehicle.in_transport]
    if code is None or code in codes.VEHICLE_CONTACTS:
        said = "not known" if code is None else str(code)
        listed = "such event" if record.events else "events"
        raise _incomplete(f"nothing tells what happened: HARM_EV {said}, and the report lists no {listed}")
    if len(moving) != 1 and code in MODELLED:
        which = f"which of {record.moving_vehicles} vehicles" if len(moving) > 1 else "which vehicle"
        what = codes.HARM_EV.meaning(code)
        raise _incomplete(f"nothing tells {which} in transport {what}: the report lists no such event")
    vehicle = moving[0] if moving else None
    struck = thing_party(1) if code in _OBJECTS | codes.ANIMALS else None
    number, area = (None, None) if vehicle is None else (vehicle.number, vehicle.impact)
    return [EventRecord(1, code, number, area, struck, None, ("code", "party_1", "area_1"))]


def _implied_overturns(record: CrashRecord, harmful: Sequence[EventRecord]) -> Iterator[EventRecord]:
    """Yield an overturn after all events for each vehicle that rolled over (``ROLLOVER``), if the report lists none."""
    if record.events and "events" not in record.implied:
        return
    overturned = {event.party_1 for event in harmful if event.code == codes.OVERTURN}
    numbers = count(harmful[-1].number + 1)
    for vehicle in record.vehicles:
        if vehicle.rollover_code not in (None, *codes.NO_ROLLOVER) and vehicle.number not in overturned:
            yield EventRecord(next(numbers), codes.OVERTURN, vehicle.number, None, None, None, ("code", "party_1"))


def unlisted_vehicles(record: CrashRecord) -> str | None:
    """Return a sentence if the report lists fewer vehicles in transport than ``VE_FORMS``, else None.

    >>> unlisted_vehicles(replace(record, vehicles=record.vehicles[:1]))
    'the report lists 1 of 2 vehicles in transport'
    """
    listed = sum(vehicle.in_transport for vehicle in record.vehicles)
    if listed >= record.moving_vehicles:
        return None
    return f"the report lists {listed} of {record.moving_vehicles} vehicles in transport"


def _not_modelled(harmful: Sequence[EventRecord]) -> Rejection:
    told = [f"event {event.number} {event_in_words(event)} (SOE {event.code})" for event in harmful[:_MOST_TOLD]]
    if len(harmful) > _MOST_TOLD:
        told.append(f"and {len(harmful) - _MOST_TOLD} more")
    what = codes.HARM_EV.meaning(harmful[0].code)
    return Rejection(Reason.NOT_MODELLED, f"a crash that begins with this is not modelled: {what}; {', '.join(told)}")


# --- who takes part --------------------------------------------------------------------------------------------------
class _Reader:
    """The events read so far, and the open questions."""

    def __init__(self, record: CrashRecord) -> None:
        self._record = record
        self._vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
        self._met: set[int] = set()  # vehicles that have touched somebody or something
        self._animal: int | None = None  # number of the first event with one: there is only one animal
        struck = [event for event in record.events if event.kind is EventKind.PERSON_STRUCK]
        self._of_each_event = len(struck) <= (record.people_outside or 1)
        self._unlisted: dict[int, NonMotorist] = {}  # people whom the report strikes and does not list: by event where
        # it counts one for each of them (PEDS), else one by code
        self.events: list[CrashEvent] = []
        self.unclear: dict[int, str] = {}

    def add(self, event: EventRecord) -> None:
        """Add one harmful event."""
        if event.code not in MODELLED:
            return
        vehicle = self._vehicles.get(event.party_1 or 0)
        if vehicle is None:
            self.unclear[event.number] = f"event {event.number} (SOE {event.code}) does not say of which vehicle it is"
            return
        made = self._made(event, vehicle)
        if made is None:
            return
        if self.events and self.events[-1].is_contact and made.pair == self.events[-1].pair:
            self.events[-1] = replace(self.events[-1], going_on=(*self.events[-1].going_on, event.number))
        else:
            self.events.append(made)
        if made.kind is not EventKind.OVERTURN:
            self._met |= {vehicle.number, made.party}

    def _made(self, event: EventRecord, vehicle: VehicleRecord) -> CrashEvent | None:
        partner: Partner = None
        if event.kind is EventKind.VEHICLE_CONTACT:
            partner = self._vehicles.get(self._other_vehicle(event) or 0)
            if partner is None or partner is vehicle:
                self.unclear[event.number] = (
                    f"event {event.number} (SOE {event.code}) does not say whom vehicle {vehicle.number} met"
                )
                return None
        elif event.kind in (EventKind.PERSON_STRUCK, EventKind.ANIMAL_STRUCK):
            partner = self._struck(event)
            if partner is None:
                persons = len(self._record.non_motorists)
                which = (
                    f"say which of {persons} persons was struck" if persons > 1 else "name the person that was struck"
                )
                self.unclear[event.number] = f"event {event.number} does not {which}"
                return None
        left = _last_departure(self._record, event)
        return CrashEvent(
            number=event.number,
            code=event.code,
            kind=event.kind,
            vehicle=vehicle,
            area=None if event.kind is EventKind.OVERTURN else self._area(vehicle, event.area_1),
            partner=partner,
            partner_area=self._area(partner, event.area_2) if isinstance(partner, VehicleRecord) else None,
            side=None if left is None else side_after(left.code, keeps_left=vehicle.keeps_left),
            departure=None if left is None else left.number,
        )

    def _area(self, vehicle: VehicleRecord, area: ImpactArea | None) -> ImpactArea | None:
        """Return the area of an event; if none is given, the initial impact of a vehicle not struck before."""
        return vehicle.impact if area is None and vehicle.number not in self._met else area

    def _other_vehicle(self, event: EventRecord) -> int | None:
        """Return the second vehicle of a contact; if the event does not name it, the only other one."""
        if event.party_2 is not None or event.code not in _OF_TWO_IN_TRANSPORT or self._record.moving_vehicles != 2:
            return event.party_2
        others = [vehicle.number for vehicle in self._record.vehicles if vehicle.number != event.party_1]
        return others[0] if len(others) == 1 else None

    def _struck(self, event: EventRecord) -> NonMotorist | None:
        """Return the person of an event, named or implied, or a :class:`StruckAnimal`; None if unknown."""
        if event.kind is EventKind.ANIMAL_STRUCK:
            own = event.number if event.party_2 is None else event.party_2 - thing_party(0)
            self._animal = own if self._animal is None else self._animal
            return StruckAnimal(self._animal)
        listed = self._record.non_motorists
        named = next((person for person in listed if person.party == event.party_2), None)
        if named is None and listed and not self._record.events:
            struck = {_PERSON_TYPE[event.code], UNKNOWN_NON_MOTORIST}
            possible = [person for person in listed if person.person_type_code in struck]
            named = possible[0] if len(possible) == 1 else None
        if named is not None and named.person_type_code == UNKNOWN_NON_MOTORIST:
            return replace(named, person_type_code=_PERSON_TYPE[event.code])
        if named is not None or listed:
            return named
        which = event.number if self._of_each_event else event.code
        return self._unlisted.setdefault(which, NonMotorist(1 + len(self._unlisted), _PERSON_TYPE[event.code]))


def _last_departure(record: CrashRecord, until: EventRecord) -> EventRecord | None:
    """Return a vehicle's last departure to a known side before another event of it."""
    own = [each for each in record.events if each.number < until.number and each.party_1 == until.party_1]
    return next((each for each in reversed(own) if each.code in SIDE_AFTER_EVENT), None)


# --- what is missing -------------------------------------------------------------------------------------------------
def _missing_from(record: CrashRecord, harmful: Sequence[EventRecord], reader: _Reader) -> str | None:
    """Return a sentence on the open questions of the sequence, or None.

    They concern the parties of the first event or of a contact, and each vehicle's part if more than two met.
    """
    several = len(record.vehicles) > 2 or record.moving_vehicles > 2 or record.kind is CrashKind.PARKED
    meet = any(event.kind is EventKind.VEHICLE_CONTACT for event in harmful)
    if meet and several and (unlisted := unlisted_vehicles(record)) is not None:
        return unlisted
    needed = [event.number for event in harmful if event.kind in CONTACTS or event is harmful[0]]
    unclear = next((reader.unclear[number] for number in needed if number in reader.unclear), None)
    if unclear is not None:
        return unlisted_vehicles(record) or unclear
    silent = _without_part(record, harmful) if meet and several else []
    if not silent:
        return None
    numbers = " and ".join(map(str, silent))
    return f"nothing tells what part vehicle{'s' if len(silent) > 1 else ''} {numbers} had: no event that is known"


def _without_part(record: CrashRecord, harmful: Iterable[EventRecord]) -> list[int]:
    """Return the vehicles without a harmful event that is known."""
    taking_part: set[int | None] = set()
    for event in harmful:
        if event.is_vehicle_contact or event.kind is not EventKind.VEHICLE_CONTACT:
            taking_part |= {event.party_1, event.party_2}
    return [vehicle.number for vehicle in record.vehicles if vehicle.number not in taking_part]
