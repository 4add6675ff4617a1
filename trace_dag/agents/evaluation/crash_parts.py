"""Parts in a conflict by the report: the vehicle that began it and the one that had to respond."""

from __future__ import annotations

from enum import StrEnum

from trace_dag.crash.record import CrashRecord, VehicleRecord

_OWN_DOING = range(1, 50)  # P_CRASH2: loss of control, and what the vehicle itself was doing
_RUN_INTO = range(50, 53)  # another one that stood, was slower or slowed down ahead of it
_OTHERS_DOING = range(53, 93)  # another vehicle, a person, an animal or an object that came into its way
_UNTOLD = 1  # between its own doing and another's


class CrashPart(StrEnum):
    """A driver's part in a conflict, as in the studies of Chandler (Scanlon et al., Waymo, 2021)."""

    INITIATOR = "initiator"
    RESPONDER = "responder"


def part_of(record: CrashRecord, number: int) -> CrashPart | None:
    """Return a driver's part by the critical event of each vehicle (``P_CRASH2``).

    The initiator is the vehicle whose own action made the crash imminent, or the one that runs into a vehicle ahead. If
    that does not distinguish the drivers, the initiator is the only one who was speeding or had been drinking. None if
    the drivers cannot be distinguished. Charged violations are not used.

    >>> part_of(record, 1), part_of(record, 2)  # a car that turns left across a motorcycle
    (<CrashPart.INITIATOR: 'initiator'>, <CrashPart.RESPONDER: 'responder'>)
    """
    by_number = {each.number: each for each in record.vehicles if each.in_transport}
    own = by_number.pop(number, None)
    if own is None:
        return None
    if not by_number:  # it met a person or an animal
        doing = _own_doing(own)
        return None if doing == _UNTOLD else CrashPart.RESPONDER if doing < _UNTOLD else CrashPart.INITIATOR
    for says in (_own_doing, _was_unfit):
        most = max(says(each) for each in by_number.values())
        if says(own) != most:
            return CrashPart.INITIATOR if says(own) > most else CrashPart.RESPONDER
    return None


def _own_doing(vehicle: VehicleRecord) -> int:
    """Return a score from 0 to 3 of how far the critical event is the vehicle's own action: 3 own, 0 another's."""
    code = vehicle.critical_event_code
    if code in _OWN_DOING:
        return 3
    if code in _RUN_INTO:
        return 2
    return 0 if code in _OTHERS_DOING else _UNTOLD


def _was_unfit(vehicle: VehicleRecord) -> int:
    return int(bool(vehicle.speeding or vehicle.driver_drinking))
