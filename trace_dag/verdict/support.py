"""Support of an accepted crash: each independent fact of its report for or against it, their sum, and a grade.

The three criteria test whether the simulated contact fits the report, but the estimator chooses hypotheses that do.
Support tests the other reported facts of the place and the course. The weight of a fact is the logarithm of a
likelihood ratio: the probability that it agrees (or differs) in a true report at its true place, over that in a
control. The probabilities follow from the counts in ``support_weights.csv``, measured on FARS reports of Virginia 2023
and of Arizona, California, Ohio and South Dakota 2012 to 2016 (``lab/fit_support.py``). The facts' weights add up, in
the manner of naive Bayes.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Final

from trace_dag.crash.contradictions import name_contradictions
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.verdict.course_facts import course_facts, crosswalk_facts, departure_facts, pedestrian_facts
from trace_dag.verdict.place_facts import place_facts
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Agreement, ComparedWith, Fact, Grade, Reservation, Support

LEAST_FACTS: Final = 6
"""Independent facts of map and course that have to agree for a crash to be corroborated."""
LEAST_SUPPORT: Final = 6.0
"""Sum of weights from which on a crash is corroborated: e^6, four hundred times likelier in a true report than in a
control. Below it too many reports pass that were set down at another place whose map numbers no routes."""
_MOST: Final = 4.0
"""The largest weight either way (55 times likelier): what so few crashes can show, and no fact decides alone."""
_PRIOR: Final = 0.5
"""Added to every count (Jeffreys): what was never seen is not impossible."""

_ESSENTIAL_CONTRADICTIONS: Final = frozenset(
    {
        "classes of crash types",
        "pair of crash types",
        "single driver",
        "impact and crash type",
        "impact and course",
        "impact and event",
        "impacts and manner",
        "impact and damage",
        "one lane",
        "junction",
        "second street",
        "route",
        "turn away from junctions",
        "first event",
        "first event and sequence",
    }
)
"""Subjects on which a report has to agree with itself: place, parties and manner, parts struck."""


@dataclass(frozen=True)
class Weight:
    """Frequencies of one outcome of a fact: ``true_share`` of true reports, ``chance_share`` of controls."""

    fact: str
    agreement: Agreement
    true_count: int
    true_of: int
    chance_count: int
    chance_of: int

    @property
    def log_likelihood_ratio(self) -> float:
        """Return the logarithm of the ratio of the two shares, each count with a prior, limited to :data:`_MOST`.

        A disagreement never supports a crash, even if it is rare in controls and few true reports have it.
        """
        levels = len(Agreement)
        true = (self.true_count + _PRIOR) / (self.true_of + levels * _PRIOR)
        chance = (self.chance_count + _PRIOR) / (self.chance_of + levels * _PRIOR)
        most = 0.0 if self.agreement is Agreement.DIFFERS else _MOST
        return min(max(math.log(true / chance), -_MOST), most)


Weights = Mapping[tuple[str, Agreement], float]


def facts_of(record: CrashRecord, network: RoadNetwork, report: MapReport, beside: Comparison) -> tuple[Fact, ...]:
    """Return every fact of the report that can be compared with the map, the course or the report itself.

    They are not weighed yet. Without any event they are only those of the place and of the report.

    >>> facts = facts_of(record, network, map_report, comparison)
    >>> len({fact.name for fact in facts}), [fact.name for fact in facts if fact.agreement is Agreement.DIFFERS]
    (19, [])
    """
    seen = {number: drove for event in reversed(beside.observed.events) for number, drove in event.vehicles.items()}
    return (
        *place_facts(record, network, report, tuple(seen.values())),
        *crosswalk_facts(beside, report.placement),
        *_contradictions(record),
        *facts_of_course(beside),
    )


def facts_of_course(beside: Comparison) -> tuple[Fact, ...]:
    """Return the facts of the course alone, by the kind of the first event."""
    return tuple(_COURSE_FACTS[beside.sequence.first.kind](beside))


_COURSE_FACTS: Final[Mapping[EventKind, Callable[[Comparison], Iterator[Fact]]]] = {
    EventKind.VEHICLE_CONTACT: course_facts,
    EventKind.PERSON_STRUCK: pedestrian_facts,
    EventKind.ANIMAL_STRUCK: pedestrian_facts,
    EventKind.OBJECT_STRUCK: departure_facts,
    EventKind.OVERTURN: departure_facts,
}
"""Which facts of the course there are, by what the crash begins with."""


def _contradictions(record: CrashRecord) -> Iterator[Fact]:
    for about, sentence in name_contradictions(record):
        essential = about in _ESSENTIAL_CONTRADICTIONS
        yield Fact(about, ComparedWith.RECORD, Agreement.DIFFERS, sentence, "the record contradicts itself", essential)


def assess_support(facts: Iterable[Fact], weights: Weights | None = None) -> Support:
    """Return the facts with weights and their sum; ``weights`` default to those of the package.

    A fact reported for both vehicles is one fact: its weights are averaged, so that repetition does not count twice.

    >>> fact = Fact("lanes", ComparedWith.MAP, Agreement.AGREES, "4", "4")
    >>> of_both = (replace(fact, vehicle_number=number) for number in (1, 2))
    >>> support = assess_support(of_both, {("lanes", Agreement.AGREES): 0.5})
    >>> support.total, support.independent_facts  # one thing
    (0.5, 1)
    """
    table = fitted_weights() if weights is None else weights
    given = tuple(facts)
    times = Counter(fact.name for fact in given)
    weighed = tuple(
        replace(fact, weight=table.get((fact.name, fact.agreement), 0.0) / times[fact.name]) for fact in given
    )
    agreeing = {fact.name for fact in weighed if fact.against is not ComparedWith.RECORD}
    agreeing -= {fact.name for fact in weighed if fact.agreement is not Agreement.AGREES}
    total = math.fsum(fact.weight for fact in weighed)
    return Support(weighed, total, len(agreeing), _why_not(weighed, total, len(agreeing)))


def _why_not(facts: tuple[Fact, ...], total: float, agreeing: int) -> str:
    refuting = [_sentence(fact) for fact in facts if fact.refutes]
    if refuting:
        return "; ".join(dict.fromkeys(refuting))
    if agreeing < LEAST_FACTS:
        return f"{agreeing} independent facts agree, {LEAST_FACTS} needed"
    if total < LEAST_SUPPORT:
        return f"support {total:+.1f}, {LEAST_SUPPORT:+.1f} needed"
    return ""


def _sentence(fact: Fact) -> str:
    if fact.against is ComparedWith.RECORD:
        return fact.reported
    whose = f" of vehicle {fact.vehicle_number}" if fact.vehicle_number is not None else ""
    where = "the map" if fact.against is ComparedWith.MAP else "the simulated course"
    return f"{fact.name}{whose}: reported {fact.reported}, {where} has {fact.found}"


def grade_of(support: Support | None, reservations: Sequence[Reservation] = ()) -> Grade:
    """Return the grade of an accepted crash.

    A missing event affects its label rather than its support.

    >>> grade_of(None).value
    'consistent'
    """
    doubted = any(each.doubt.bars_corroboration for each in reservations)
    supported = support is not None and not support.detail
    return Grade.CORROBORATED if supported and not doubted else Grade.CONSISTENT


@cache
def fitted_weights() -> Weights:
    """Return the weights of the package's table."""
    table = resources.files("trace_dag.verdict").joinpath("support_weights.csv")
    return weights_of(read_weights(table.read_text(encoding="utf-8")))


def weights_of(counts: Iterable[Weight]) -> Weights:
    """Return the weight of each fact, by its outcome.

    >>> weights = weights_of([Weight("lanes", Agreement.AGREES, 40, 50, 10, 50)])
    >>> round(weights["lanes", Agreement.AGREES], 1)  # ln(0.8 / 0.2), a little less by the prior
    1.3
    """
    return {(row.fact, row.agreement): row.log_likelihood_ratio for row in counts}


def read_weights(text: str) -> Iterator[Weight]:
    r"""Yield the rows of a table of weights: CSV with a header.

    >>> header = "fact,agreement,true_count,true_of,chance_count,chance_of"
    >>> (weight,) = read_weights(f"{header}\nlanes,agrees,40,50,10,50")
    >>> weight.true_count, weight.chance_of
    (40, 50)
    """
    for row in csv.DictReader(text.splitlines()):
        counts = (int(row[name]) for name in ("true_count", "true_of", "chance_count", "chance_of"))
        yield Weight(row["fact"], Agreement(row["agreement"]), *counts)
