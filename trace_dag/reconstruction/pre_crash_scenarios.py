"""Encounters: the possible readings of how two vehicles met.

Crash types, critical events, movements and the sequence of events give a short list of readings of the record. A
reading says how the two approaches relate and which vehicle entered the other's path. If the record is silent, every
reading stays, with its prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from trace_dag.crash.classes import CollisionType, RoadTopology
from trace_dag.crash.crash_types import (
    CrashType,
    CriticalEvent,
    EncounterRole,
    Relation,
    Side,
    Turn,
    crash_type_of,
    critical_event,
    opposite_side,
    turn_of,
)
from trace_dag.crash.derive import UNSAID_MOVEMENTS
from trace_dag.crash.record import CrashRecord, EventRecord, PreCrashMovement, VehicleRecord

_LEFT_ITS_LANE = frozenset({64, 65, 68})  # SOE: ran off left, cross median, cross centre line
CROSS_MEDIAN = 65

_SAID_BY_ONE = math.log(0.5)  # log-likelihood if the two crash types name different relations
_UNSAID = math.log(0.25)
_HINT = 2.0  # of a critical event that names the relation where no crash type does
_MANNER_SAYS: Final[Mapping[CollisionType, Mapping[Relation, float]]] = {
    CollisionType.FRONT_TO_REAR: {Relation.SAME_LANE: 0.0, Relation.SAME_DIRECTION: -2.9},
    CollisionType.FRONT_TO_FRONT: {Relation.OPPOSITE_DIRECTION: 0.0},
    CollisionType.ANGLE: {Relation.CROSSING: 0.0, Relation.OPPOSITE_DIRECTION: -0.7, Relation.SAME_DIRECTION: -3.3},
    CollisionType.SIDESWIPE_SAME_DIRECTION: {Relation.SAME_DIRECTION: 0.0},
    CollisionType.SIDESWIPE_OPPOSITE_DIRECTION: {Relation.OPPOSITE_DIRECTION: 0.0},
}
"""Weights of ``MAN_COLL`` for each relation: log-likelihood ratios from 120 crashes of Virginia (2023) and FARS (2012
to 2016) whose ``ACC_TYPE`` says the relation, half a crash added to each. It is that of the first harmful event."""
_NEVER_SO = -4.0  # log-likelihood ratio of relations that none of those crashes has
_TURNING_ACROSS = 0.28
"""Share of vehicles that turned left, of 92 that went straight or turned left in angle crashes at intersections
(Virginia 2023 and FARS 2012 to 2016)."""
_UNREPORTED_CENTRELINE = -2.0  # log-likelihood ratio: reports seldom leave out that somebody crossed it
_AGAINST_ROLE = -3.0
_AGAINST_EVENT = -1.5
_KEEP_WITHIN = 3.0


@dataclass(frozen=True)
class Party:
    """One of the two vehicles with all facts of the record about its part."""

    vehicle: VehicleRecord
    crash_type: CrashType
    critical: CriticalEvent
    turn: Turn | None
    events: frozenset[int]  # SOE of its non-collision events before the collision
    record: CrashRecord = field(repr=False, compare=False)

    @property
    def backing(self) -> bool:
        """Return whether it drove backward."""
        return self.crash_type.backing or self.vehicle.movement is PreCrashMovement.BACKING

    @property
    def stationary(self) -> bool:
        """Return whether the vehicle stood still, by its reported speed or else by its movement."""
        if self.vehicle.travel_speed_mps is not None:
            return self.vehicle.travel_speed_mps == 0 and self.vehicle.movement is not PreCrashMovement.STARTING
        return self.crash_type.stopped or self.vehicle.movement in (
            PreCrashMovement.STOPPED,
            PreCrashMovement.PARKED_IN_LANE,
        )

    @property
    def encroached(self) -> float:
        """Return the log-odds that this vehicle left its path or struck the other; 0 without evidence."""
        role = {
            EncounterRole.ENCROACHING: 1.0,
            EncounterRole.STRIKING: 1.0,
            EncounterRole.STEADY: -1.0,
            EncounterRole.STRUCK: -1.0,
        }
        odds = role.get(self.crash_type.role, 0.0) * -_AGAINST_ROLE
        if self.critical.own is not None:
            odds += (1.0 if self.critical.own else -1.0) * -_AGAINST_EVENT
        if self.events & _LEFT_ITS_LANE:
            odds -= _AGAINST_EVENT
        return odds


@dataclass(frozen=True)
class PreCrashScenario:
    """One reading: ``mover`` left its path, turned, backed, or struck from behind; ``other`` did not.

    ``mover_from`` is the side of ``other`` from which the mover came (crossing) or on which it was (same direction);
    None allows both. ``log_prior`` weighs the reading by the record.
    """

    relation: Relation
    mover: Party
    other: Party
    mover_from: Side | None
    log_prior: float


def party(record: CrashRecord, vehicle: VehicleRecord) -> Party:
    """Return the reported part of one vehicle.

    >>> party(queue_record, queue_record.vehicles[0]).crash_type.relation.value  # crash type 20: rear-end, stopped
    'same_lane'
    """
    own_events: list[EventRecord] = []
    for event in record.events:
        if vehicle.number in (event.party_1, event.party_2):
            if event.is_vehicle_contact:
                break
            own_events.append(event)
    return Party(
        vehicle,
        crash_type_of(vehicle),
        critical_event(vehicle.critical_event_code),
        turn_of(vehicle),
        frozenset(event.code for event in own_events),
        record,
    )


def pre_crash_scenarios(record: CrashRecord, one: Party, two: Party) -> tuple[PreCrashScenario, ...]:
    """Return all readings of the record within reach of the likeliest, likeliest first.

    >>> parts = (party(record, vehicle) for vehicle in record.vehicles)
    >>> pre_crash_scenarios(record, *parts)[0].mover.vehicle.number  # the one that turns across the other
    1
    """
    found = [
        replace(scenario, log_prior=scenario.log_prior + weight_1 + weight_2)
        for first, weight_1 in _possible(record, one)
        for second, weight_2 in _possible(record, two)
        if first is one or second is two or not (first.turn and second.turn)
        for scenario in _scenarios(record, first, second)
    ]
    best = max(scenario.log_prior for scenario in found)
    kept = [scenario for scenario in found if scenario.log_prior > best - _KEEP_WITHIN]
    return tuple(sorted(kept, key=lambda scenario: -scenario.log_prior))


def _possible(record: CrashRecord, each: Party) -> list[tuple[Party, float]]:
    """Return a party's possible readings.

    In an angle crash at an intersection, a party without a reported movement goes straight on or turns across oncoming
    traffic, each with its log-probability; otherwise it is as reported.
    """
    unsaid = (
        each.vehicle.movement in UNSAID_MOVEMENTS and each.crash_type.relation is None and each.critical.own is None
    )
    at_intersection = record.road_topology is not RoadTopology.NOT_AN_INTERSECTION
    if not unsaid or record.collision_type is not CollisionType.ANGLE or not at_intersection:
        return [(each, 0.0)]
    across = PreCrashMovement.TURNING_RIGHT if each.vehicle.keeps_left else PreCrashMovement.TURNING_LEFT
    moved = {PreCrashMovement.GOING_STRAIGHT: 1.0 - _TURNING_ACROSS, across: _TURNING_ACROSS}
    return [
        (party(record, replace(each.vehicle, movement=movement)), math.log(share)) for movement, share in moved.items()
    ]


def _scenarios(record: CrashRecord, one: Party, two: Party) -> Iterator[PreCrashScenario]:
    for relation, weight in _relations(record, one, two).items():
        crossing = relation is Relation.CROSSING
        orders: tuple[tuple[Party, Party], ...] = ((one, two), (two, one))
        if crossing:  # both orders mean the same there: the one that turns or backs is the mover
            orders = orders[1:] if _moves(two) > _moves(one) else orders[:1]
        for mover, other in orders:
            log_prior = weight if crossing else weight + _mover_prior(relation, mover, other)
            if relation is Relation.OPPOSITE_DIRECTION and _drifts_unreported(record, mover):
                log_prior += _UNREPORTED_CENTRELINE
            yield PreCrashScenario(relation, mover, other, _side(relation, mover, other), log_prior)


def _drifts_unreported(record: CrashRecord, mover: Party) -> bool:
    """Return whether a vehicle in an angle crash would cross the centreline without a turn, unreported."""
    said = mover.turn is not None or mover.backing or mover.crash_type.relation is not None
    return record.collision_type is CollisionType.ANGLE and not said and not mover.events & _LEFT_ITS_LANE


def _moves(each: Party) -> tuple[bool, bool]:
    return each.backing, each.turn is not None


def _relations(record: CrashRecord, one: Party, two: Party) -> dict[Relation, float]:
    if one.backing or two.backing:
        return {Relation.CROSSING: 0.0}  # along the road or out of a driveway: the candidates include both
    said = [each.crash_type.relation for each in (one, two) if each.crash_type.relation is not None]
    if said:
        return {relation: 0.0 if len(set(said)) == 1 else _SAID_BY_ONE for relation in dict.fromkeys(said)}
    weights = dict.fromkeys(Relation, _UNSAID)
    for each in (one, two):
        if each.critical.relation is not None:
            weights[each.critical.relation] += _HINT
    manner = _MANNER_SAYS.get(record.collision_type)
    if manner is not None:
        weights = {relation: weight + manner.get(relation, _NEVER_SO) for relation, weight in weights.items()}
    return weights


def _mover_prior(relation: Relation, mover: Party, other: Party) -> float:
    """Return the log-probability that ``mover``, rather than ``other``, is the one that moved, given the relation."""
    odds = mover.encroached - other.encroached
    if relation in (Relation.OPPOSITE_DIRECTION, Relation.SAME_DIRECTION):
        odds += 4.0 * ((mover.turn is not None) - (other.turn is not None))
    odds += 4.0 * (mover.backing - other.backing)
    if relation is Relation.SAME_LANE:
        # Only a faster vehicle runs into one ahead, and it does so with its front.
        odds += 2.0 * (other.stationary - mover.stationary) + 2.0 * (_front(mover) - _front(other))
        speeds = mover.vehicle.travel_speed_mps, other.vehicle.travel_speed_mps
        if speeds[0] is not None and speeds[1] is not None and speeds[0] != speeds[1]:
            odds += 2.0 if speeds[0] > speeds[1] else -2.0
    return -math.log1p(math.exp(-odds)) if odds > -30 else odds


def _front(each: Party) -> int:
    """Return 1 for a vehicle struck at the front, -1 at the rear, 0 elsewhere or unknown."""
    if each.vehicle.impact is None:
        return 0
    along = math.cos(each.vehicle.impact.centre_rad)
    return 1 if along > 0.7 else -1 if along < -0.7 else 0


def _side(relation: Relation, mover: Party, other: Party) -> Side | None:
    """Return the side of ``other`` from which the mover came, or on which it was."""
    if relation not in (Relation.CROSSING, Relation.SAME_DIRECTION):
        return None
    if other.crash_type.relation is relation and other.crash_type.other_from is not None:
        return other.crash_type.other_from
    if mover.crash_type.relation is relation and mover.crash_type.other_from is not None:
        return opposite_side(mover.crash_type.other_from)
    if relation is Relation.SAME_DIRECTION:
        over = {60: Side.LEFT, 61: Side.RIGHT}  # P_CRASH2 of the other: over its left or right lane line
        return over.get(other.vehicle.critical_event_code or 0)
    return None
