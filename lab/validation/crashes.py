"""Each measured crash in the simulator: what its vehicles' recorders would have said, beside what they did say.

Three kinds. *Both*: both vehicles have a recorded delta-v and speed, nothing is free. *One*: one has; the other's speed
is fitted to the delta-v that the case's investigators reconstructed from crush, for the simulator and for the plastic
peer alike. *Object*: a vehicle that struck a tree or a pole at its recorded speed.
"""

from __future__ import annotations

from collections.abc import Iterator

from lab.validation.pairs import compare_pair
from lab.validation.posts import POSTS, compare_with_post
from lab.validation.recorded import RecordedCrash, RecordedEvent
from lab.validation.rows import Compared, Unusable
from trace_dag.common.settings import SimSettings


def compare_crash(crash: RecordedCrash, settings: SimSettings) -> list[Compared]:
    """Return the vehicles of a case; with a reason those that cannot be compared."""
    rows: dict[int | None, Compared] = {}
    if crash.unreadable is not None:
        return [Compared(crash.case, None, "", reason=crash.unreadable)]
    try:
        rows = {row.vehicle: row for row in _compared(crash, settings)}
        reason = "was not in the event that is compared"
    except Unusable as unusable:
        reason = str(unusable)
    numbers: list[int | None] = [*crash.vehicles] or [None]
    return [rows.get(number) or Compared(crash.case, number, "", reason=reason) for number in numbers]


def _compared(crash: RecordedCrash, settings: SimSettings) -> Iterator[Compared]:
    event = _event_of_two(crash)
    if event is not None:
        assert event.other_vehicle is not None
        pair = crash.vehicles[event.vehicle], crash.vehicles[event.other_vehicle]
        return compare_pair(crash.case, event, pair, settings)
    others = []
    for event in crash.events:
        vehicle = crash.vehicles.get(event.vehicle)
        if vehicle is None or vehicle.recording(event.number) is None:
            continue
        if event.object_code in POSTS:
            return iter([compare_with_post(crash.case, event, vehicle, settings)])
        nothing_of_it = ", of which the file has nothing" if event.other_vehicle is not None else ""
        others.append(event.object_name + nothing_of_it)
    recorded = f"; recorded: {', '.join(dict.fromkeys(others))}" if others else ""
    raise Unusable(f"no recorder has a delta-v of an event of two vehicles, or of one into a tree or pole{recorded}")


def _event_of_two(crash: RecordedCrash) -> RecordedEvent | None:
    """Return the first event of two vehicles that as many recorders as possible have a delta-v of."""
    best: tuple[int, RecordedEvent] | None = None
    for event in crash.events:
        if event.other_vehicle is None or event.vehicle == event.other_vehicle:
            continue
        pair = [crash.vehicles.get(number) for number in (event.vehicle, event.other_vehicle)]
        if any(vehicle is None for vehicle in pair):
            continue
        recorded = sum(vehicle is not None and vehicle.recording(event.number) is not None for vehicle in pair)
        if recorded > (best[0] if best else 0):
            best = recorded, event
    return best[1] if best else None
