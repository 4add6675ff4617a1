"""The leaderboard of the benchmark page: agents side by side, and the results of each by class of crashes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from trace_dag.agents.evaluation.crash_parts import CrashPart
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation.shares import clustered_share, share_avoided
from trace_dag.pages.page_templates import templates
from trace_dag.version import __version__

Row = Mapping[str, Any]

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
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in leaderboard:
        groups.setdefault((row["split"] or "", row["traffic"] or ""), []).append(row)
    dimensions: dict[str, dict[str, dict[str, Row]]] = {}
    for row in by_class:
        dimensions.setdefault(row["dimension"], {}).setdefault(row["class"], {})[row["agent"]] = row
    runs_of: dict[str, list[Row]] = {}
    for row in runs:
        runs_of.setdefault(row["agent"], []).append(row)
    likely: dict[str, list[Row]] = {}
    for row in probabilities:
        likely.setdefault(row["agent"], []).append(row)
    avoided = {
        agent: {part: share_avoided(run for run in of_agent if part in ("all", run["part"])) for part in _PARTS}
        for agent, of_agent in runs_of.items()
    }
    page = (
        templates()
        .get_template("site_leaderboard.html.jinja")
        .render(
            version=__version__,
            leaderboard=leaderboard,
            groups=groups,
            avoided=avoided,
            runs_of=runs_of,
            probabilities={
                agent: (clustered_share((row["key"], row["avoided"]) for row in rows), rows)
                for agent, rows in likely.items()
            },
            dimensions=dimensions,
            outcomes=OUTCOMES,
        )
    )
    return page.encode()
