"""What happened after a contact, beside what the report says: objects struck, to which side, overturns.

Shown, and judges nothing: where a struck vehicle goes depends on what its driver and its wheels still did, which no
report tells. The objects were placed on the vehicle's way, so that striking one says only that the vehicle left the
road there. Whether it left it at all, to which side, and whether it overturned, is simulated.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from trace_dag.crash.aftermath import Afterwards, aftermath_of
from trace_dag.crash.record import CrashRecord
from trace_dag.geometry import contact_clock_h
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.sim.leaving_road import left_road_after_contact
from trace_dag.sim.types import SimulationLog, overturned_at
from trace_dag.states.types import Hypothesis
from trace_dag.verdict.metrics import clock_error_h
from trace_dag.verdict.rules import shown
from trace_dag.verdict.types import Criterion


def aftermath_shown(
    record: CrashRecord, network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog
) -> Iterator[Criterion]:
    """A criterion per later object and overturn of the report, in its order; of objects that are struck also to which
    side the vehicle left the road, and how far from the reported area it was struck (hours).

    >>> list(aftermath_shown(record, network, hypothesis, log))  # the report tells of nothing after the collision
    []
    """
    since_s: dict[int, float] = {}  # of each vehicle's last event that happened
    for contact in log.meetings:
        for number in (contact.number_1, contact.number_2):
            since_s.setdefault(number, contact.time_s)
    happens = {check.name: check.detail for check in hypothesis.aftermath if check.passed}
    why_not = {check.name: check.detail for check in hypothesis.aftermath if not check.passed}
    for event in aftermath_of(record):
        number = event.vehicle.number
        if number not in since_s:  # it meets nobody, which is judged elsewhere
            continue
        if event.struck is None:
            yield _overturn(event, log, since_s[number], happens.get(event.name, ""))
            continue
        struck = next((c for c in log.strikes_of(event.struck.party) if c.number_1 == number), None)
        if struck is None or struck.time_s < since_s[number]:
            planned = "the simulation does not have it" if event.name in happens else "no object was placed for it"
            detail = why_not.get(event.name, planned)
            yield _held("later_object", event, held=False, detail=detail)
            continue
        since_s[number] = struck.time_s
        yield _held("later_object", event, held=True, detail=happens.get(event.name, ""))
        if event.side is not None:
            sides = left_road_after_contact(network, log, number, struck.time_s)
            held = event.side in sides
            detail = "" if held else f"the vehicle leaves the road {' or '.join(sides)}, reported is {event.side}"
            yield _held("later_side", event, held=held, detail=detail)
        clock_h = contact_clock_h(*log.clock_body(struck, number), np.array([struck.x_m, struck.y_m]))
        error_h = clock_error_h(clock_h, event.struck.area)
        yield shown("later_clock_error", error_h, "h", number, event.event_number)


def _overturn(event: Afterwards, log: SimulationLog, since_s: float, came_of: str) -> Criterion:
    driven = log.vehicle_log(event.vehicle.number)
    step = overturned_at(driven)
    over = step is not None and float(driven.time_s[step]) >= since_s
    tilted_deg = float(np.degrees(np.abs(driven.roll_rad).max()))
    detail = came_of if over else f"vehicle {event.vehicle.number} tilts by {tilted_deg:.0f} degrees at most"
    return _held("later_overturn", event, held=over, detail=detail)


def _held(name: str, event: Afterwards, *, held: bool, detail: str) -> Criterion:
    return Criterion(name, float(held), 1.0, "", held, None, detail, event.vehicle.number, event.event_number)
