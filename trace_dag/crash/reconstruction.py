"""What a crash is reconstructed as: estimators, verdicts and controls choose their method by it.

Not the same as its kind: a crash of two vehicles in which something else came first is reconstructed for their
collision.
"""

from __future__ import annotations

from enum import StrEnum

from trace_dag.crash.contacts import is_of_contacts
from trace_dag.crash.departures import is_of_departure, overturns_first
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.strikes import is_of_strikes


class Reconstruction(StrEnum):
    """What is reconstructed of a crash."""

    COLLISION = "collision"  # the first contact of two vehicles
    STRIKES = "strikes"  # every strike of a person or an animal, in order
    CONTACTS = "contacts"  # every contact of three and more vehicles, or with a parked one, in order
    DEPARTURE = "departure"  # one vehicle leaves the road, and what it strikes there
    OVERTURN = "overturn"  # one vehicle overturns before it strikes anything


def reconstruction_of(record: CrashRecord) -> Reconstruction:
    """What the crash is reconstructed as.

    >>> [reconstruction_of(each).value for each in (record, queue_record, pedestrian_record, tree_record)]
    ['collision', 'contacts', 'strikes', 'departure']
    """
    if is_of_departure(record):
        return Reconstruction.OVERTURN if overturns_first(record) else Reconstruction.DEPARTURE
    if is_of_strikes(record):
        return Reconstruction.STRIKES
    return Reconstruction.CONTACTS if is_of_contacts(record) else Reconstruction.COLLISION
