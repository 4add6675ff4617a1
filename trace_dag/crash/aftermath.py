"""What a vehicle does after a contact, by the report: it strikes a fixed object, or overturns.

In 30 % of the fatal crashes of two vehicles of 2016 a vehicle did so after the first contact (fixed objects in 21 %,
overturns in 15 %), and in 46 % of those with an animal. The side to which it had left the road is that of its last
departure (``SOE`` 63, 64, 71) before that: coded for 96 % of the objects after a contact of two vehicles.

A vehicle that leaves the road before it meets anybody does not belong here: :mod:`trace_dag.crash.departures`.
"""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.crash.codes.events import FIXED_OBJECTS, LIVE_ANIMAL, OVERTURN
from trace_dag.crash.departures import SIDE_OF_EVENT, DepartureSide, ObjectStruck
from trace_dag.crash.kind import CrashKind
from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord, EventRecord, VehicleRecord


@dataclass(frozen=True)
class Afterwards:
    """An object that a vehicle struck after a contact, or its overturn where there is no ``struck``.

    ``side`` is where it left the road before, as its driver sees it, by the event ``departure``; None where no event
    says it.
    """

    event_number: int
    vehicle: VehicleRecord
    struck: ObjectStruck | None
    side: DepartureSide | None
    departure: int | None = None

    @property
    def name(self) -> str:
        """What it is called in a hypothesis."""
        return f"{'overturn' if self.struck is None else 'object'} of event {self.event_number}"


def aftermath_of(record: CrashRecord) -> tuple[Afterwards, ...]:
    """What vehicles that met somebody did afterwards, in the order of the events; nothing where the crash is
    reconstructed by a departure, or by strikes of people.

    >>> aftermath_of(record)  # its events end with the collision
    ()
    >>> from dataclasses import replace
    >>> then = replace(record.events[0], number=2, code=42, party_1=2, party_2=None)  # vehicle 2 strikes a tree
    >>> [(each.name, each.vehicle.number) for each in aftermath_of(replace(record, events=(*record.events, then)))]
    [('object of event 2', 2)]
    """
    method = reconstruction_of(record)
    if method not in (Reconstruction.COLLISION, Reconstruction.CONTACTS) and record.kind is not CrashKind.ANIMAL:
        return ()
    met: set[int] = set()
    found = []
    for event in record.events:
        if _is_meeting(event):
            met |= {number for number in (event.party_1, event.party_2) if number is not None}
        elif event.party_1 in met and (event.code in FIXED_OBJECTS or event.code == OVERTURN):
            vehicle = next((each for each in record.vehicles if each.number == event.party_1), None)
            if vehicle is not None:
                overturns = event.code == OVERTURN
                struck = None if overturns else ObjectStruck(event.number, event.code, event.area_1)
                left = _departure(record, event)
                side, number = (None, None) if left is None else (SIDE_OF_EVENT[left.code], left.number)
                found.append(Afterwards(event.number, vehicle, struck, side, number))
    return tuple(found)


def _is_meeting(event: EventRecord) -> bool:
    return event.is_vehicle_contact or event.code == LIVE_ANIMAL


def _departure(record: CrashRecord, until: EventRecord) -> EventRecord | None:
    """A vehicle's last departure to a known side before another event of it."""
    own = [each for each in record.events if each.number < until.number and each.party_1 == until.party_1]
    return next((each for each in reversed(own) if each.code in SIDE_OF_EVENT), None)
