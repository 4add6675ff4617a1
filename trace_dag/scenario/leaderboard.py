"""The leaderboard of the benchmark page: agents side by side, and what each made of each class of crashes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from trace_dag.version import __version__

Row = Mapping[str, Any]

OUTCOMES = ("avoided", "softened", "same", "worse", "faulty")


def write_leaderboard(leaderboard: Sequence[Row], by_class: Sequence[Row], runs: Sequence[Row]) -> bytes:
    """``leaderboard.html`` from the rows of the warehouse's views ``leaderboard`` and ``leaderboard_by_class``, and the
    ``evaluations`` in crashes (not in their variations)."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["words"] = lambda value: str(value).replace("_", " ")
    environment.filters["percent"] = lambda value: "–" if value is None else f"{100 * value:.0f} %"
    environment.filters["fixed"] = lambda value: "–" if value is None else f"{value:.1f}"
    dimensions: dict[str, dict[str, dict[str, Row]]] = {}
    for row in by_class:
        dimensions.setdefault(row["dimension"], {}).setdefault(row["class"], {})[row["agent"]] = row
    runs_of: dict[str, list[Row]] = {}
    for row in runs:
        runs_of.setdefault(row["agent"], []).append(row)
    template = resources.files("trace_dag.scenario").joinpath("templates", "site_leaderboard.html.jinja")
    page = environment.from_string(template.read_text(encoding="utf-8")).render(
        version=__version__, leaderboard=leaderboard, runs_of=runs_of, dimensions=dimensions, outcomes=OUTCOMES
    )
    return page.encode()
