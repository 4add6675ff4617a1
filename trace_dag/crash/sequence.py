"""The sequence of a crash's events: from ``CEvent``, else ``VEvent``, else put together from the vehicles' (``VSOE``).

Belongs here: reading events, and filling blank codes, which are marked as implied. Does not belong here: finding the
parties that met (:mod:`trace_dag.crash.meetings`), and the values that events imply for vehicles
(:mod:`trace_dag.crash.derive`).

The table of 2015 leaves 29 % of its codes blank. The national table of 2016 has no blanks, and shows their meaning:
among the codes that 2015 lacks, a vehicle's first event without harm is a departure from the roadway in 97 % of cases
(19,377 of 19,922); half of the later ones are returns to it. So a first blank row becomes a departure, to the side of
``ACC_TYPE``, and later ones stay unknown. The first harmful event is ``HARM_EV`` where only one vehicle can have had
it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.crash_types import Side, crash_type
from trace_dag.crash.derive import impact_area
from trace_dag.crash.fields import Fields
from trace_dag.crash.meetings import VehicleEvent, merge_sequences
from trace_dag.crash.record import EventRecord, VehicleRecord

_DEPARTURES: Final = {Side.RIGHT: codes.RAN_OFF_RIGHT, Side.LEFT: codes.RAN_OFF_LEFT, None: codes.RAN_OFF}


@dataclass(frozen=True)
class ReadSequence:
    """The events in order, parties named where they are vehicles.

    ``implied``: names of values that were not read; ``contradictions``: sentences on the rows; ``order_known``: False
    if the sequence was joined from those of the vehicles.
    """

    events: tuple[EventRecord, ...]
    implied: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    order_known: bool = True


@dataclass(frozen=True)
class _Row:
    """A row of ``VSOE``; ``code`` is None if it is blank."""

    vehicle: int
    code: int | None
    area_code: int | None

    @property
    def harmful(self) -> bool:
        return self.area_code != codes.NOT_HARMFUL and (self.code is None or self.code in codes.HARM_EV.meanings)


def read_sequence(crash: Fields, vehicles: Sequence[VehicleRecord]) -> ReadSequence:
    """Return the sequence of a crash, given its vehicles.

    >>> from trace_dag.crash.parse import open_report
    >>> report, _ = open_report(report_xml, name="a report")
    >>> events = read_sequence(report.fields("a report"), record.vehicles).events
    >>> [event.code for event in events]  # SOE 12: another vehicle in transport
    [12]
    """
    harm_ev = crash.known_code("HARM_EV")
    own = [*crash.rows("vehicle"), *crash.rows("parkwork")]
    rows, strays = _own_rows(own, {vehicle.number for vehicle in vehicles})
    of_crash = list(crash.rows("cevent", "event"))
    of_vehicles = [row for vehicle in own for row in vehicle.own_rows("vevent", "event")]
    if of_crash or of_vehicles:
        # VEvent repeats the crash's events for every vehicle that took part in them.
        events, unlisted = _event_rows(of_crash or of_vehicles, vehicles)
        return ReadSequence(events, () if of_crash else ("events",), (*strays, *unlisted, *_differences(events, rows)))
    if rows:
        events, chosen = merge_sequences(
            _mended(rows, vehicles, harm_ev),
            vehicles,
            contact_first=harm_ev in codes.VEHICLE_CONTACTS,
            man_coll=crash.known_code("MAN_COLL"),
        )
        implied = ("events", "order_of_contacts") if chosen else ("events",)
        return ReadSequence(events, implied, strays, order_known=False)
    events = _first_harmful(crash, vehicles, harm_ev)
    return ReadSequence(events, ("events",) if events else (), strays)


def known_by_events_alone(vehicle: Fields) -> bool:
    """Return whether a vehicle has no row of its own, only a number that other tables name."""
    return not vehicle.names() - {"VEH_NO"}


def has_struck_standing_only(vehicle: Fields) -> bool:
    """Return whether a vehicle's own events are only those of a standing one, struck while parked or at work."""
    found = {row.code for row in _rows_of(vehicle)}
    return bool(found) and found <= codes.STRUCK_STANDING


def _event_rows(
    rows: Iterable[Fields], vehicles: Sequence[VehicleRecord]
) -> tuple[tuple[EventRecord, ...], tuple[str, ...]]:
    numbers = {vehicle.number for vehicle in vehicles}
    events: dict[int, EventRecord] = {}
    set_in_motion: set[int] = set()  # events in which what the first vehicle had set in motion touched the second
    unlisted: dict[str, None] = {}

    def listed(fields: Fields, event: int, name: str) -> int | None:
        number = fields.integer(name)
        if number is None or number in codes.NO_SECOND_VEHICLE or number in numbers:
            return number if number in numbers else None
        unlisted.setdefault(f"event {event}: {name} says vehicle {number}, which the report does not list")
        return None

    for fields in rows:
        number, code = fields.integer("EVENTNUM", low=1), fields.code("SOE")
        if number is None or code is None:
            continue  # a blank row says nothing
        area_1 = fields.code("AOI", "AOI1")
        if code in codes.STRUCK_STANDING | codes.FIXED_OBJECTS and area_1 in codes.SET_IN_MOTION:
            set_in_motion.add(number)
        events.setdefault(
            number,
            EventRecord(
                number=number,
                code=code,
                party_1=listed(fields, number, "VNUMBER1"),
                area_1=impact_area(area_1),
                party_2=listed(fields, number, "VNUMBER2"),
                area_2=impact_area(fields.code("AOI", "AOI2")),
            ),
        )
    in_order = [events[number] for number in sorted(events)]
    return _with_pushed(in_order, set_in_motion), tuple(unlisted)


def _with_pushed(events: Sequence[EventRecord], set_in_motion: Collection[int]) -> tuple[EventRecord, ...]:
    """Return the events with the pushed vehicle in place of the vehicle that pushed it.

    A standing vehicle has no events of its own. A contact into which it was pushed is coded as an event of the vehicle
    that struck it, with an area of impact for "set in motion" (190 of 440 contacts with a second standing vehicle of
    2016, 22 of 98 objects after a contact with one). The pushed vehicle is the one struck just before; if that was an
    object, the event stays as it is.
    """
    found: list[EventRecord] = []
    last: dict[int | None, EventRecord] = {}  # harmful event of each vehicle, as coded
    for event in events:
        before = last.get(event.party_1)
        pushes = before is not None and (
            before.is_vehicle_contact if event.is_vehicle_contact else before.code in codes.STRUCK_STANDING
        )
        if event.number in set_in_motion and before is not None and pushes:
            pushed = replace(event, party_1=before.party_2, area_1=None, implied=(*event.implied, "party_1"))
            found.append(pushed if pushed.party_1 != pushed.party_2 else event)
        else:
            found.append(event)
        if event.is_harmful:
            last[event.party_1] = event
    return tuple(found)


def _own_rows(own: Sequence[Fields], numbers: set[int]) -> tuple[dict[int, list[_Row]], tuple[str, ...]]:
    """Return rows of ``VSOE`` by vehicle in order, and sentences on rows of vehicles that do not exist."""
    rows: dict[int, list[_Row]] = {}
    strays: dict[str, None] = {}
    for vehicle in own:
        for row in _rows_of(vehicle):
            if row.vehicle in numbers:
                rows.setdefault(row.vehicle, []).append(row)
            else:
                strays.setdefault(f"VSOE has events of vehicle {row.vehicle}, which the report does not list")
    return rows, tuple(strays)


def _rows_of(vehicle: Fields) -> list[_Row]:
    number = vehicle.integer("VEH_NO") or 0
    rows: list[tuple[int, _Row]] = []
    for fields in vehicle.own_rows("vsoe", f"vehicle {number}, event"):
        row = _Row(fields.integer("VEH_NO") or number, fields.code("SOE"), fields.code("AOI", "AOI"))
        rows.append((fields.integer("VEVENTNUM") or len(rows) + 1, row))
    return [row for _, row in sorted(rows, key=lambda each: each[0])]


def _differences(events: Sequence[EventRecord], rows: Mapping[int, Sequence[_Row]]) -> tuple[str, ...]:
    """Return sentences on contacts that only a vehicle's own sequence has, or only the crash's."""
    sentences = []
    for number, own in rows.items():
        of_own = {row.code for row in own if row.code in codes.VEHICLE_CONTACTS}
        of_crash = {
            event.code
            for event in events
            if event.code in codes.VEHICLE_CONTACTS and number in (event.party_1, event.party_2)
        }
        for here, there, missing in (("VSOE", "CEvent", of_own - of_crash), ("CEvent", "VSOE", of_crash - of_own)):
            sentences += [
                f"vehicle {number}: {here} says that it met another vehicle (SOE {code}), but {there} does not"
                for code in sorted(code for code in missing if code is not None)
            ]
    return tuple(sentences)


def _mended(
    rows: Mapping[int, Sequence[_Row]], vehicles: Sequence[VehicleRecord], harm_ev: int | None
) -> dict[int, list[VehicleEvent]]:
    """Return the rows as events, with blank codes filled if their meaning is clear, and else unknown."""
    crash_types = {vehicle.number: vehicle.crash_type_code for vehicle in vehicles}
    blank = _blank_first_events(rows, harm_ev)
    mended: dict[int, list[VehicleEvent]] = {}
    for number, own in rows.items():
        departure = next((row for row in own if row.code is None and not row.harmful), None)
        mended[number] = []
        for row in own:
            code = row.code
            if code is None and any(row is each for each in blank):
                code = harm_ev
            elif code is None and row is departure:
                code = _DEPARTURES[crash_type(crash_types.get(number)).departure]
            known = codes.UNKNOWN_EVENT if code is None else code
            mended[number].append(VehicleEvent(number, known, impact_area(row.area_code), mended=code != row.code))
    return mended


def _blank_first_events(rows: Mapping[int, Sequence[_Row]], harm_ev: int | None) -> list[_Row]:
    """Return the blank rows that must be the crash's first harmful event.

    They belong to one vehicle, or to the two that met in it.
    """
    firsts = [first for own in rows.values() if (first := next((row for row in own if row.harmful), None)) is not None]
    blank = [row for row in firsts if row.code is None]
    parties = 2 if harm_ev in codes.VEHICLE_CONTACTS else 1
    missing = parties - sum(row.code == harm_ev for row in firsts)
    return blank if harm_ev is not None and missing > 0 and len(blank) == missing else []


def _first_harmful(crash: Fields, vehicles: Sequence[VehicleRecord], harm_ev: int | None) -> tuple[EventRecord, ...]:
    """Return the event that ``HARM_EV`` implies in a report without events, if it is a contact of vehicles.

    Its parties are named if the crash has only two.
    """
    if harm_ev not in codes.VEHICLE_CONTACTS:
        return ()
    moving = [vehicle.number for vehicle in vehicles if vehicle.in_transport]
    standing = [vehicle.number for vehicle in vehicles if not vehicle.in_transport]
    parties = moving if harm_ev not in codes.STRUCK_STANDING else moving + standing
    stated = crash.integer("VE_FORMS")
    certain = len(parties) == 2 and bool(moving) and stated in (None, len(moving))
    event = EventRecord(1, harm_ev, None, None, None, None, ("code",))
    if certain:
        event = replace(event, party_1=parties[0], party_2=parties[1], implied=("code", "party_1", "party_2"))
    return (event,)
