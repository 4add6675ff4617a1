"""What ``controls --perturbed`` prints: verdicts on changed reports, a line per perturbation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from trace_dag.cli.printing import print_table

if TYPE_CHECKING:
    from trace_dag.studies.perturbed import PerturbedRow

CORROBORATED = "corroborated"


def print_perturbed(rows: Sequence[PerturbedRow]) -> None:
    """A line per perturbation: changed reports judged, verified, corroborated, and accepted of the crash's own
    simulation."""
    from trace_dag.verdict.perturbed.kinds import KINDS

    lines = []
    for name, kind in KINDS.items():
        of_kind = [row for row in rows if row.perturbation == name]
        judged = [row for row in of_kind if row.accepted is not None]
        own = [row.own_accepted for row in of_kind if row.own_accepted is not None]
        graded = [row for row in judged if row.grade is not None or not row.accepted]
        if not of_kind:
            continue
        lines.append(
            (
                name,
                kind.title,
                len({row.key for row in of_kind}),
                len(judged),
                sum(bool(row.accepted) for row in judged),
                sum(row.grade == CORROBORATED for row in judged) if len(graded) == len(judged) else "",
                f"{sum(own)} of {len(own)}",
            )
        )
    print_table(["perturbation", "changed", "crashes", "judged", "verified", "corroborated", "own"], lines)
