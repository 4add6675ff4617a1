"""Verdicts: criteria, each with its value, threshold and whether it holds, and supporting facts."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from pydantic import Field, ValidationError

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Failure, Reason
from trace_dag.reconstruction.alternatives import Approached


@dataclass(frozen=True)
class Criterion:
    """``passed`` is None if the report has no value to compare: shown as not evaluated, never as a pass.

    ``reason`` is the reason of the rejection if this criterion fails; None for criteria that are only reported.
    ``vehicle_number`` is the number of the party, ``event_number`` that of the record's event; a collision of two
    vehicles is judged as a whole and has none.
    """

    name: str
    value: float | None
    threshold: float | None
    unit: str
    passed: bool | None
    reason: Reason | None = None
    detail: str = ""
    vehicle_number: int | None = None
    event_number: Annotated[int | None, Field(exclude_if=lambda number: number is None)] = None


class Label(StrEnum):
    """Labels: agreement of the simulated events with the reported ones."""

    VERIFIED = "verified"  # every harmful event that can be modelled, in order, and the harm can have come of it
    FIRST_EVENT_ONLY = "first_event_only"  # accepted by its first event; something reported does not happen, or no harm
    REJECTED = "rejected"


class Grade(StrEnum):
    """Support for an accepted crash: corroborated by enough independent facts, or consistent and no more."""

    CORROBORATED = "corroborated"
    CONSISTENT = "consistent"


class Agreement(StrEnum):
    """Agreement of one fact of a report with its counterpart."""

    AGREES = "agrees"
    NEAR = "near"  # not the same, but what reports and maps often have for each other
    DIFFERS = "differs"

    @classmethod
    def of(cls, agrees: bool) -> Agreement:
        """Return the agreement of a fact that either agrees or differs."""
        return cls.AGREES if agrees else cls.DIFFERS


class ComparedWith(StrEnum):
    """Counterparts with which a fact is compared."""

    MAP = "map"
    COURSE = "course"  # as simulated
    RECORD = "record"  # other fields of the same report


@dataclass(frozen=True)
class Fact:
    """One reported fact that can be compared with the map, the simulated course, or another field.

    ``essential``: if it differs, the crash is not corroborated, regardless of other facts. ``weight`` is its
    log-likelihood ratio (natural logarithm), positive for support of the crash.
    """

    name: str
    against: ComparedWith
    agreement: Agreement
    reported: str
    found: str
    essential: bool = False
    vehicle_number: int | None = None
    weight: float = 0.0

    @property
    def refutes(self) -> bool:
        """Return whether the fact by itself prevents corroboration."""
        return self.essential and self.agreement is Agreement.DIFFERS


@dataclass(frozen=True)
class Support:
    """Every compared fact of a report, with its weight, and their sum.

    ``total`` is the sum of the weights; ``independent_facts`` counts the different facts that agree, one of both
    vehicles once; ``detail`` is the reason why the crash is not corroborated, or "".
    """

    facts: tuple[Fact, ...]
    total: float
    independent_facts: int
    detail: str = ""


class EventResult(StrEnum):
    """Outcomes of a reported harmful event in the simulation."""

    HAPPENED = "happened"
    MISSED = "missed"
    NOT_MODELLED = "not_modelled"  # no simulation here can have it: a fire, a train


@dataclass(frozen=True)
class EventOutcome:
    """A harmful event of the report and its outcome: the time (s), or ``why`` it does not happen.

    One that continues the previous event has no time of its own.
    """

    event_number: int
    code: int
    outcome: EventResult
    why: str = ""
    time_s: float | None = None


class Doubt(StrEnum):
    """A difference between an accepted crash and its report that no support outweighs."""

    EVENT_MISSED = "event_missed"  # a harmful one
    HARMLESS = "harmless"
    OTHER_STREET = "other_street"
    CENTRELINE_NOT_CROSSED = "centreline_not_crossed"
    MEDIAN_NOT_CROSSED = "median_not_crossed"
    DEPARTURE_MISSED = "departure_missed"
    RETURN_MISSED = "return_missed"
    NOT_AIRBORNE = "not_airborne"
    OTHER_ZONE = "other_zone"
    UNREPORTED_OVERTURN = "unreported_overturn"
    UNREPORTED_DEPARTURE = "unreported_departure"
    OTHER_VEHICLE_MISSING = "other_vehicle_missing"  # of a critical event
    NO_STREET = "no_street"  # where a vehicle was going to drive
    FAR_OFF_ROAD = "far_off_road"
    OTHER_CARRIAGEWAY = "other_carriageway"
    SPUN = "spun"  # before the first event
    STARTS_IN_LANE = "starts_in_lane"  # of a person who crosses
    OTHER_JUNCTION = "other_junction"
    OTHER_FACE = "other_face"  # of a vehicle, within the positions that a criterion allows
    OBJECTS_OVERLAP = "objects_overlap"
    OBJECT_AT_REST = "object_at_rest"  # placed where the vehicle stops anyway
    NO_AREAS = "no_areas"  # of impact, in a register that has none

    @property
    def bars_verification(self) -> bool:
        """Return whether a crash with this doubt is only accepted by its first event; by eye, none was right."""
        return self is not Doubt.NO_AREAS

    @property
    def bars_corroboration(self) -> bool:
        """Return whether the doubt concerns street, course or areas; a missing event affects the label instead."""
        return self not in (Doubt.EVENT_MISSED, Doubt.HARMLESS)


@dataclass(frozen=True)
class Reservation:
    """A doubt about an accepted crash, and its sentence."""

    doubt: Doubt
    detail: str


@dataclass(frozen=True)
class SightLine:
    """The view that one of two parties had of the other until they met.

    The other is visible without interruption for the last ``seen_for_s`` before the contact. ``hidden_s`` are the times
    of the simulation (s) between which it is hidden, ``hidden_share`` is their part of the last seconds; ``hidden_by``
    is the obstacle that hides it longest, with its element in OpenStreetMap ("way/12") if it is from there.
    """

    driver: int
    other: int
    seen_for_s: float
    hidden_share: float
    hidden_s: tuple[tuple[float, float], ...] = ()
    hidden_by: str = ""
    osm_id: str = ""


@dataclass(frozen=True)
class Verdict:
    """The judgement of one crash.

    It is of the first hypothesis (in the estimate's order) that is verified, else of the first that is accepted, else
    of the first.

    ``label`` is the agreement of events, ``grade`` the support (None for a rejected crash), ``direction_open`` the
    sides that are still possible, empty if one is likely. ``support`` is None without a contact, and for comparisons of
    one simulation with many reports. ``events`` are the harmful events of the report in order, ``reservations`` the
    doubts about an accepted crash, ``sight_lines`` those of the two that met first.
    """

    key: str
    rule_set: str
    label: Label
    hypothesis: int  # index in the estimate
    hypotheses_judged: int
    criteria: tuple[Criterion, ...]
    reason: Reason | None = None  # why it is rejected
    detail: str = ""
    grade: Grade | None = None
    support: Support | None = None
    events: tuple[EventOutcome, ...] = ()
    reservations: tuple[Reservation, ...] = ()
    alternatives: str = ""  # other likely courses, in words; "" where no other side has a quarter
    direction_open: tuple[Approached, ...] = ()
    sight_lines: tuple[SightLine, ...] = ()

    @property
    def accepted(self) -> bool:
        """Return whether no criterion of the rule set rejects the crash."""
        return self.label is not Label.REJECTED

    @property
    def verified(self) -> bool:
        """Return whether every reported harmful event that can be modelled happens and can have caused the harm."""
        return self.label is Label.VERIFIED

    def criterion(self, name: str, vehicle_number: int | None = None) -> Criterion | None:
        """Return the criterion of that name (and vehicle), if it was measured."""
        for criterion in self.criteria:
            if criterion.name == name and criterion.vehicle_number == vehicle_number:
                return criterion
        return None

    def worst(self, *names: str) -> float | None:
        """Return the largest size of the named criteria's values, over both vehicles; None if none was evaluated."""
        return max((abs(c.value) for c in self.criteria if c.name in names and c.value is not None), default=None)

    def all_hold(self, name: str) -> bool | None:
        """Return whether every evaluated criterion of that name holds; None if none was evaluated."""
        evaluated = [c.passed for c in self.criteria if c.name == name and c.passed is not None]
        return all(evaluated) if evaluated else None


def verdict_to_json(verdict: Verdict) -> bytes:
    """Return a verdict as stored: every criterion with value, threshold, unit and result."""
    return json_adapter(Verdict).dump_json(verdict, indent=1)


def verdict_from_json(data: bytes) -> Verdict:
    """Return a stored verdict.

    Raises :class:`Failure` if it is not one of this version.
    """
    try:
        return json_adapter(Verdict).validate_json(data)
    except ValidationError as error:
        raise Failure(f"verdict: its JSON is not of this version ({error}); judge again") from error
