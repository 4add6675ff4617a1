"""Fit the weights by which a report's facts support a verdict, and say how well they do on crashes left out.

    python -m lab fit_support ROOT --cohort va-2023 --cohort fars-csv

``ROOT`` holds computed crashes of all kinds. True reports at their true places are those accepted there. Facts of the
place are worth what they are over all kinds: a street's name does not know who met on it. Facts of the course have
names of their own by what a crash begins with (vehicles that meet, people or animals struck, a departure from the
road). Controls of the place are the same reports at the places of other crashes of the cohort, and at random points of
their own maps at least 300 m away on another street, each with a road map, an estimate and a simulation made anew.
Controls of the course are the simulations beside other crashes' reports. A fact's weight is the logarithm of how many
times likelier it is to come out so in a true report than in its controls; how often it did in each is the table
``trace_dag/verdict/support_weights.csv``. Printed are the rates of grades where each crash is judged by weights fitted
to all the others.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from trace_dag.common.errors import Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import Settings
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import CrashRecord
from trace_dag.flow.artefacts import EXTRACT, MAP_REPORT
from trace_dag.flow.stored_crashes import StoredCrash, judged_crashes
from trace_dag.flow.workspace import Workspace
from trace_dag.osm.road_classes import PUBLIC_HIGHWAYS
from trace_dag.osm.types import OsmExtract
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.build import build_road_map
from trace_dag.roads.crash_site.street_names import similarity
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.verdict.controls import in_place_of
from trace_dag.verdict.judge import judge
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.support import Weight, assess_support, facts_of, facts_of_course, grade_of, weights_of
from trace_dag.verdict.types import Agreement, ComparedWith, Fact, Grade

TABLE = Path(__file__).parents[1] / "trace_dag/verdict/support_weights.csv"
PLACES_OF_EACH = 2
REPORTS_OF_EACH = 20
LEAST_M, MOST_M = 300.0, 800.0


@dataclass(frozen=True)
class Judged:
    """One report at one place: "true", "foreign site", "random point" or, unjudged, "other report" of the course."""

    kind: str
    begins: str  # kind of the first event
    keys: frozenset[str]  # whose report, at whose place
    accepted: bool
    facts: tuple[Fact, ...]


def main() -> None:
    """Fit, write the table, print the cross-validated rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root")
    parser.add_argument("--cohort", action="append", help="only these; the sample's crashes are made up")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    workspace = Workspace.open(arguments.root)
    cohorts = arguments.cohort or workspace.registry.cohorts()
    keys = [(cohort, key) for cohort in cohorts for key in workspace.registry.keys(cohort)]
    tasks = [(arguments.root, cohort, key) for cohort, key in keys]
    with get_context("fork").Pool(arguments.workers, maxtasksperchild=16) as pool:
        rows = [row for found in pool.imap(_rows_of, tasks) for row in found]
    write_table(counts(rows))
    print_rates(rows)


def write_table(table: Iterable[Weight]) -> None:
    """Write the counts as the package holds them."""
    names = ("fact", "agreement", "true_count", "true_of", "chance_count", "chance_of")
    rows = sorted(table, key=lambda row: row.fact)
    lines = [",".join(names), *(",".join(str(getattr(row, name)) for name in names) for row in rows)]
    TABLE.write_text("\n".join(lines) + "\n")


def counts(rows: Iterable[Judged], *, without: str | None = None) -> list[Weight]:
    """Count the outcomes of each fact, crash ``without`` left out."""
    true: dict[str, Counter[Agreement]] = defaultdict(Counter)
    chance: dict[str, Counter[Agreement]] = defaultdict(Counter)
    for row in rows:
        if without in row.keys:
            continue
        for fact in row.facts:
            if fact.against is ComparedWith.RECORD:
                continue  # a contradiction is essential or a note, not weighed
            if row.kind == "true":
                true[fact.name][fact.agreement] += 1
            elif (fact.against is ComparedWith.COURSE) == (row.kind == "other report"):
                chance[fact.name][fact.agreement] += 1
    return [
        Weight(
            name, agreement, true[name][agreement], true[name].total(), chance[name][agreement], chance[name].total()
        )
        for name in sorted(true.keys() & chance.keys())
        for agreement in Agreement
        if true[name][agreement] or chance[name][agreement]
    ]


def print_rates(rows: list[Judged]) -> None:
    """Print the accepted and corroborated by kind and first event, each judged by weights fitted without it."""
    keys = {min(row.keys) for row in rows}
    weights = {key: weights_of(counts(rows, without=key)) for key in keys}
    rates: dict[tuple[str, str], Counter[Grade]] = defaultdict(Counter)
    crashes: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        crashes[row.begins].add(min(row.keys))
        if row.kind != "other report":
            support = assess_support(row.facts, weights[min(row.keys)])
            rates[row.kind, row.begins][grade_of(row.accepted, support)] += 1
    for (kind, begins), grades in sorted(rates.items()):
        total, corroborated = grades.total(), grades[Grade.CORROBORATED]
        accepted = corroborated + grades[Grade.CONSISTENT]
        print(f"{kind:14} {begins:16} {total:4} judged, {accepted:4} accepted, {corroborated:4} corroborated", end="")
        print(f" ({corroborated / total:.1%})")
    print("; ".join(f"{begins}: {len(found)} crashes" for begins, found in sorted(crashes.items())))


# --- one crash ---------------------------------------------------------------------------------------------------
def _rows_of(task: tuple[str, str, str]) -> list[Judged]:
    root, cohort, key = task
    workspace = Workspace.open(root)
    found = judged_crashes(workspace, [key])
    if not found or not found[0].accepted:
        return []
    own, rng = found[0], np.random.default_rng(int(key.replace("-", "")))
    begins = own.judged.sequence.first.kind
    others = [other for other in workspace.registry.keys(cohort) if other != key]
    others = [others[index] for index in rng.permutation(len(others))]
    rows = [_true(own)]
    places = reports = 0
    for other in others:
        if places == PLACES_OF_EACH and reports == REPORTS_OF_EACH:
            break
        there = next(iter(judged_crashes(workspace, [other])), None)
        if there is None or not there.accepted or there.judged.sequence.first.kind is not begins:
            continue
        if places < PLACES_OF_EACH:
            record = there.judged.record
            extract = there.files.load(EXTRACT)
            rows += _at(own, "foreign site", other, extract, record.latitude_deg, record.longitude_deg)
            places += 1
        if reports < REPORTS_OF_EACH:
            rows += _beside(own, there)
            reports += 1
    extract = own.files.load(EXTRACT)
    for latitude_deg, longitude_deg in _random_points(own.judged.record, extract, rng):
        rows += _at(own, "random point", key, extract, latitude_deg, longitude_deg)
    return rows


def _true(own: StoredCrash) -> Judged:
    crash, report = own.judged, own.files.load(MAP_REPORT)
    beside = Comparison.of(crash.record, crash.sequence, crash.observed, Settings().verdict)
    facts = facts_of(crash.record, crash.network, report, beside)
    return Judged("true", crash.sequence.first.kind, frozenset({crash.record.key}), own.accepted, facts)


def _at(
    own: StoredCrash,
    kind: str,
    place: str,
    extract: OsmExtract,
    latitude_deg: float,
    longitude_deg: float,
) -> Iterator[Judged]:
    """Yield the report at another place, all stages from the road map on."""
    settings = Settings()
    record = replace(own.judged.record, latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    try:
        built = build_road_map(extract, record, settings.roads)
        network = built.stored.network
        states = estimate(record, network, built.report, settings.states)
    except Rejection:
        return
    logs = simulate(EmbeddedBackend(settings.sim), network, built.stored.xodr, states, settings.sim, record=record)
    verdict = judge(record, network, built.report, states, logs, settings.verdict)
    facts = verdict.support.facts if verdict.support else ()
    yield Judged(kind, own.judged.sequence.first.kind, frozenset({record.key, place}), verdict.accepted, facts)


def _beside(own: StoredCrash, other: StoredCrash) -> Iterator[Judged]:
    """Yield the simulation beside another crash's report."""
    crash = own.judged
    foreign = in_place_of(other.judged.record, crash.record)
    if foreign is None:
        return
    beside = Comparison.of(foreign, sequence_of(foreign), crash.observed, Settings().verdict)
    facts = facts_of_course(beside)
    keys = frozenset({crash.record.key, foreign.key})
    yield Judged("other report", crash.sequence.first.kind, keys, False, facts)


def _random_points(record: CrashRecord, extract: OsmExtract, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield points on public roads that are not one of the reported streets, as likely anywhere along them."""
    frame = LocalFrame(record.latitude_deg, record.longitude_deg)
    reported = (record.trafficway_1, record.trafficway_2)
    pieces, lengths = [], []
    for way in extract.ways:
        names = [way.tags[key] for key in ("name", "ref", "alt_name") if key in way.tags]
        compared = [value for name in reported if (value := similarity(name, names)) is not None]
        if way.tags.get("highway") not in PUBLIC_HIGHWAYS or not compared or max(compared) >= 0.4:
            continue
        nodes = [extract.nodes[node] for node in way.node_ids]
        line = frame.to_local(np.array([n.latitude_deg for n in nodes]), np.array([n.longitude_deg for n in nodes]))
        for start, end in pairwise(line):
            if LEAST_M < math.hypot(*((start + end) / 2)) < MOST_M:
                pieces.append((start, end))
                lengths.append(math.dist(start, end))
    for _ in range(PLACES_OF_EACH if pieces else 0):
        start, end = pieces[int(rng.choice(len(pieces), p=np.array(lengths) / sum(lengths)))]
        latitude_deg, longitude_deg = frame.to_geographic(start + rng.uniform() * (end - start)).tolist()
        yield latitude_deg, longitude_deg


if __name__ == "__main__":
    main()
