"""The summary table of each study for the terminal and the UI, the shares that the UI draws, and the leaderboard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from trace_dag.agents.evaluation.crash_parts import CrashPart
from trace_dag.agents.evaluation.metrics import AVOIDED, OFF_ROAD_S, DriveOutcome
from trace_dag.agents.evaluation.shares import Share, clustered_share, effective_number, share_avoided
from trace_dag.agents.evaluation.table import Row
from trace_dag.agents.families import FamilyReport
from trace_dag.agents.stored_traffic import TrafficReport
from trace_dag.common.messages.wording import percent
from trace_dag.pages.page_templates import render
from trace_dag.verdict.controls import ControlRow

Name = TypeVar("Name")


class StudyTable(NamedTuple):
    """Names of columns, and rows of cells. ``shares`` are drawn as a picture with the title ``of_what``."""

    names: list[str]
    rows: list[tuple[Any, ...]]
    shares: Sequence[Share] = ()
    of_what: str = ""


_CHANGED = {
    "mirrored": "its own, the side mirrored",
    "shifted": "its own, one party late",
    "moved": "its own, the object or the parked vehicle moved",
    "dropped": "its own, one contact dropped",
    "swapped": "its own, two contacts swapped",
}


def controls_table(found: Mapping[str, Sequence[ControlRow]]) -> StudyTable:
    """Return the rates at which verdicts accept true and changed pairings, by cohort and kind of crash.

    A pairing is a simulation with its own report, with another crash's, or with its own after a change: one party late
    or mirrored, the object moved, one contact dropped, or two swapped.
    """
    lines: list[tuple[Any, ...]] = []
    by_kind = {
        (cohort, kind): [row for row in rows if row.crash_kind == kind]
        for cohort, rows in found.items()
        for kind in dict.fromkeys(row.crash_kind for row in rows)
    }
    for (cohort, kind), rows in by_kind.items():
        differ = [row for row in rows if row.kind == "other_report" and row.reports_differ]
        groups = (
            ("its own report", [row for row in rows if row.kind == "true"]),
            ("another crash's report", [row for row in rows if row.kind == "other_report"]),
            ("another that contradicts it", differ),
            *((title, [row for row in rows if row.kind == name]) for name, title in _CHANGED.items()),
        )
        for title, group in groups:
            if not group:
                continue
            judged = [row for row in group if row.verified is not None]
            verified = [row for row in judged if row.verified]
            kept = [row for row in verified if row.speeds_kept is not False]
            rates = [f"{100 * len(part) / len(judged):.1f} %" if judged else "" for part in (verified, kept)]
            lines.append((cohort, kind, title, len(judged), len(verified), *rates))
    names = ["cohort", "kind", "judged against", "judgements", "verified", "rate", "speeds kept too"]
    shares = [
        Share(
            f"{kind.replace('_', ' ')}: {title}" if len(found) == 1 else f"{cohort}, {kind}: {title}", verified, judged
        )
        for cohort, kind, title, judged, verified, *_ in lines
    ]
    return StudyTable(names, lines, shares, "Accepted by the verdict")


def evaluations_table(rows: Sequence[Row], class_of: Callable[[Row], str], dimension: str) -> StudyTable:
    """Return the outcomes of each agent: in total, as initiator and responder, and by class of crash."""
    groups: list[tuple[str, str, list[Row]]] = []
    for agent, of_agent in _grouped(rows, lambda row: row["agent"]).items():
        in_part = _grouped(of_agent, lambda row: row.get("part"))
        groups.append((agent, "all", of_agent))
        groups += [(agent, part, in_part[part]) for part in CrashPart if part in in_part]
        groups += [(agent, name, of_class) for name, of_class in sorted(_grouped(of_agent, class_of).items())]
    lines: list[tuple[Any, ...]] = []
    for agent, group, members in groups:
        counts = Counter(row["outcome"] for row in members)
        off_road = sum((row.get("off_road_s") or 0.0) > OFF_ROAD_S for row in members)
        unfinished = sum(not (row.get("collided") or row.get("finished")) for row in members)
        share = share_avoided(members)
        avoided_in = _with_interval(share.part / share.of, share.low, share.high)
        outcomes = (counts[each] for each in DriveOutcome)
        shown = (len(members), share.crashes, avoided_in, *outcomes, off_road, unfinished)
        lines.append((agent, group.replace("_", " "), *shown))
    names = ["agent", dimension.replace("_", " "), "runs", "crashes", "avoided (95 %)"]
    names += [*(each.replace("_", " ") for each in DriveOutcome), "off road", "unfinished"]
    avoided = [names.index(each.replace("_", " ")) for each in AVOIDED]
    shares = [Share(line[0], sum(line[at] for at in avoided), line[2]) for line in lines if line[1] == "all"]
    return StudyTable(names, lines, shares, "Crashes avoided")


def probabilities_table(rows: Sequence[Mapping[str, Any]]) -> StudyTable:
    """Return each agent's probability of avoiding each crash, and the mean, with 95 % intervals.

    ``rows`` are those of ``agent_probabilities``. The intervals of a crash are over its courses, that of the mean over
    the crashes.
    """
    lines: list[tuple[Any, ...]] = []
    for agent in dict.fromkeys(row["agent"] for row in rows):
        own = [row for row in rows if row["agent"] == agent]
        share = clustered_share((row["key"], row["avoided"]) for row in own)
        courses = sum(row["courses"] for row in own)
        rest = [percent(sum(row[name] for row in own) / len(own)) for name in _BESIDE_AVOIDED]
        lines.append((agent, "all", "", courses, _with_interval(share.part / share.of, share.low, share.high), *rest))
        for row in own:
            avoided = _with_interval(row["avoided"], row["avoided_low"], row["avoided_high"])
            rest = [percent(row[name]) for name in _BESIDE_AVOIDED]
            lines.append((agent, row["key"], row["vehicle_number"], row["courses"], avoided, *rest))
    names = ["agent", "crash", "vehicle", "courses", "avoided (95 %)", *_BESIDE_AVOIDED]
    return StudyTable(names, lines)


def weigh_table(runs: Sequence[Row], weights: Mapping[str, float]) -> StudyTable:
    """Return each agent's share of avoided crashes, unweighted and weighted."""
    lines: list[tuple[Any, ...]] = []
    for agent in sorted({run["agent"] for run in runs}):
        own = [run for run in runs if run["agent"] == agent and run["case_id"] == run["key"]]
        avoided = [(run["key"], run["outcome"] in AVOIDED) for run in own]
        shares = [clustered_share(avoided, by) for by in ({}, weights)]
        effective = effective_number(np.array([weights[key] for key in sorted({run["key"] for run in own})]))
        shown = [_with_interval(each.part / each.of, each.low, each.high) for each in shares]
        lines.append((agent, len(own), shares[0].crashes, *shown, f"{effective:.1f}"))
    return StudyTable(["agent", "runs", "crashes", "avoided (95 %)", "weighted (95 %)", "effective crashes"], lines)


_BESIDE_AVOIDED = ("did_not_arrive", "rules_broken", "mitigated", "worse")


def _with_interval(share: float, low: float, high: float) -> str:
    return f"{percent(share)} ({100 * low:.0f} to {100 * high:.0f})"


def traffic_table(reports: Sequence[TrafficReport]) -> StudyTable:
    """Return a table of the numbers of placed and omitted vehicles, and of the processor time per crash, s."""
    made = [each for each in reports if not each.error]
    vehicles, left_out = sum(each.vehicles for each in made), sum(each.left_out for each in made)
    cpu_s = sum(each.cpu_s for each in made) / max(len(made), 1)
    return StudyTable(
        ["crashes", "vehicles", "left out", "CPU s a crash"],
        [(len(made), vehicles, left_out, f"{cpu_s:.1f}")],
        [Share(each.key, each.vehicles, each.vehicles + each.left_out) for each in made],
        "Vehicles around the crash, of those that came",
    )


def families_table(reports: Sequence[FamilyReport]) -> StudyTable:
    """Return a table of the numbers of variations kept and drawn."""
    kept, near_misses = sum(each.kept for each in reports), sum(each.near_misses for each in reports)
    drawn = sum(each.drawn for each in reports)
    return StudyTable(
        ["crashes", "variations", "collisions", "near misses", "drawn"],
        [(len(reports), kept, kept - near_misses, near_misses, drawn)],
        [Share(each.key, each.kept, each.drawn) for each in reports],
        "Variations kept, of those drawn",
    )


# --- leaderboard -----------------------------------------------------------------------------------------------------
_PARTS = ("all", *CrashPart)
OUTCOMES = tuple(map(str, DriveOutcome))


def write_leaderboard(
    runs: Sequence[Row], leaderboard: Sequence[Row], by_class: Sequence[Row], probabilities: Sequence[Row]
) -> bytes:
    """Return ``leaderboard.html``.

    It shows the ``evaluations`` in crashes (not in their variations), and the rows of the warehouse's views
    ``leaderboard``, ``leaderboard_by_class`` and ``agent_probabilities``.

    >>> write_leaderboard([], [], [], [])[:15]
    b'<!doctype html>'
    """
    dimensions: dict[str, dict[str, dict[str, Row]]] = {}
    for row in by_class:
        dimensions.setdefault(row["dimension"], {}).setdefault(row["class"], {})[row["agent"]] = row
    runs_of = _grouped(runs, lambda row: row["agent"])
    likely = _grouped(probabilities, lambda row: row["agent"])
    avoided = {
        agent: {part: share_avoided(run for run in of_agent if part in ("all", run["part"])) for part in _PARTS}
        for agent, of_agent in runs_of.items()
    }
    return render(
        "site_leaderboard.html.jinja",
        leaderboard=leaderboard,
        groups=_grouped(leaderboard, lambda row: (row["split"] or "", row["traffic"] or "")),
        avoided=avoided,
        runs_of=runs_of,
        probabilities={
            agent: (clustered_share((row["key"], row["avoided"]) for row in rows), rows)
            for agent, rows in likely.items()
        },
        dimensions=dimensions,
        outcomes=OUTCOMES,
    )


def _grouped(rows: Iterable[Row], name_of: Callable[[Row], Name]) -> dict[Name, list[Row]]:
    groups: dict[Name, list[Row]] = {}
    for row in rows:
        groups.setdefault(name_of(row), []).append(row)
    return groups
