"""Articulation of combination vehicles beside a reported jackknife: shown, and judges nothing.

``J_KNIFE`` says whether a combination jackknifed, in the first or a later event; the angle at which one counts as such
is nowhere defined, so that the largest angle between both is shown with the report's word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from trace_dag.crash.codes.vehicle import J_KNIFE
from trace_dag.crash.record import CrashRecord
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.types import Criterion


def articulation_shown(record: CrashRecord, log: SimulationLog) -> Iterator[Criterion]:
    """Return the largest hitch angle of each vehicle with a trailer in the simulation, degrees.

    >>> list(articulation_shown(record, log))  # neither vehicle draws a trailer
    []
    """
    reported = {vehicle.number: vehicle.jackknife_code for vehicle in record.vehicles}
    for number in sorted(log.trailers):
        angle = log.articulation_rad(number)
        if angle is None:
            continue
        word = J_KNIFE.meaning(reported.get(number)) or "not reported"
        largest_deg = math.degrees(float(np.abs(angle).max()))
        yield Criterion("articulation", largest_deg, None, "deg", None, None, f"jackknife reported: {word}", number)
