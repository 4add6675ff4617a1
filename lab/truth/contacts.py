"""Estimates of the sample's crashes of several contacts against the truth, by kind of crash.

Belongs here: ``chains/truth.json`` of the sample, whose rows are those of two vehicles (:mod:`lab.truth.vehicles`).
If a vehicle stood before it was pushed is known; how far ahead or behind another it came no report tells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import median

from lab.truth.vehicles import SampleTruth, TruthRow


@dataclass(frozen=True)
class ContactsSummary:
    """The vehicles of one kind of crash; errors are of those that were estimated."""

    kind: str
    crashes: int
    vehicles: int
    estimated: int
    lane_correct_share: float | None
    median_impact_point_error_m: float | None  # of the first contact
    median_initial_position_error_m: float | None
    worst_initial_position_error_m: float | None


def contacts_by_kind(truth: SampleTruth, rows: Iterable[TruthRow]) -> list[ContactsSummary]:
    """Return the summary of the rows, a line for each kind of crash."""
    kinds: Mapping[str, str] = {crash.key: crash.kind for crash in truth.crashes}
    of_kind: dict[str, list[TruthRow]] = {}
    for row in rows:
        of_kind.setdefault(kinds[row.key], []).append(row)
    return [_summary(kind, found) for kind, found in of_kind.items()]


def _summary(kind: str, rows: list[TruthRow]) -> ContactsSummary:
    estimated = [row for row in rows if row.initial_position_error_m is not None]
    positions = [row.initial_position_error_m for row in rows if row.initial_position_error_m is not None]
    points = {row.key: row.impact_point_error_m for row in rows if row.impact_point_error_m is not None}
    return ContactsSummary(
        kind,
        len({row.key for row in rows}),
        len(rows),
        len(estimated),
        sum(bool(row.lane_correct) for row in estimated) / len(estimated) if estimated else None,
        median(points.values()) if points else None,
        median(positions) if positions else None,
        max(positions, default=None),
    )
