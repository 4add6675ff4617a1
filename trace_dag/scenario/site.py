"""The benchmark page: a static site that opens from a file, without a server, a CDN or a request leaving it.

An index (funnel, coverage beside the published counts, a map of all crashes, filters, a table) and a page per crash
(summary, facts, picture, replay, states, every criterion, downloads). Everything shown comes from the warehouse's rows
and the artefacts; nothing is computed here but positions on a drawing. All text is escaped by the templates: reports
and maps are untrusted.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from trace_dag import __version__
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.report import MapReport
from trace_dag.states.types import StateEstimate
from trace_dag.units import mps_to_mph
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from jinja2 import Environment

Row = Mapping[str, Any]

_MAP_WIDTH_PX = 960.0
_MAP_MARGIN_PX = 18.0
_LEAST_SPAN_DEG = 0.02


@dataclass(frozen=True)
class Download:
    """A file offered on a crash's page; ``href`` is relative to that page."""

    label: str
    href: str
    size_bytes: int


@dataclass(frozen=True, eq=False)
class CrashPage:
    """What one crash's page shows: ``crash`` is its row of the ``crashes`` table, paths are relative to the page."""

    crash: Row
    outcomes: Sequence[Row]
    record: CrashRecord | None = None
    map_report: MapReport | None = None
    estimate: StateEstimate | None = None
    verdict: Verdict | None = None
    picture: str | None = None
    replay: str | None = None
    downloads: Sequence[Download] = ()


def write_index(
    crashes: Sequence[Row], funnel: Sequence[Row], coverage: Sequence[Row], failure_reasons: Sequence[Row]
) -> bytes:
    """``index.html`` from the rows of the warehouse's tables of the same names."""
    table = [_table_row(crash) for crash in crashes]
    page = (
        _templates()
        .get_template("site_index.html.jinja")
        .render(
            version=__version__,
            crashes=table,
            crashes_json=_json_for_script(table),
            filters=_filters(table),
            funnel=funnel,
            largest=max((row["crashes"] for row in funnel), default=1) or 1,
            coverage=_by_dimension(coverage),
            failure_reasons=failure_reasons,
            map=_map(table),
            counts={state: sum(row["final_state"] == state for row in table) for state in _FINAL_STATES},
        )
    )
    return page.encode()


def write_crash_page(page: CrashPage) -> bytes:
    """The page of one crash, ``crashes/<key>.html`` of the site."""
    return _templates().get_template("site_crash.html.jinja").render(page=page, version=__version__).encode()


def static_files() -> dict[str, bytes]:
    """Style and script of the site by name."""
    return {name: _read(name).encode() for name in ("site.css", "site.js")}


_FINAL_STATES = ("verified", "rejected", "failed", "pending")
_FILTERS = {
    "final_state": "Outcome",
    "collision_type": "Collision type",
    "road_topology": "Road topology",
    "vehicle_trajectory": "Vehicle trajectory",
    "state_name": "State",
    "reason": "Reason",
}


def _table_row(crash: Row) -> dict[str, Any]:
    names = ("key", "final_state", "stage_reached", "reason", "latitude_deg", "longitude_deg", "state_name", "place")
    classes = ("collision_type", "road_topology", "vehicle_trajectory")
    return {name: crash.get(name) for name in (*names, *classes, "contact_distance_m")}


def _filters(table: Sequence[Row]) -> list[dict[str, Any]]:
    filters = []
    for name, label in _FILTERS.items():
        values = sorted({str(row[name]) for row in table if row[name]})
        if values:
            filters.append({"name": name, "label": label, "values": values})
    return filters


def _by_dimension(coverage: Sequence[Row]) -> dict[str, list[Row]]:
    dimensions: dict[str, list[Row]] = {}
    for row in coverage:
        dimensions.setdefault(str(row["dimension"]), []).append(row)
    return dimensions


def _map(table: Sequence[Row]) -> dict[str, Any]:
    """Points on an equirectangular drawing true to scale at its middle latitude, with lines of a round graticule."""
    placed = [row for row in table if row["latitude_deg"] is not None and row["longitude_deg"] is not None]
    if not placed:
        return {"points": [], "width": _MAP_WIDTH_PX, "height": 0, "parallels": [], "meridians": []}
    south, north = _span([row["latitude_deg"] for row in placed])
    west, east = _span([row["longitude_deg"] for row in placed])
    shrink = math.cos(math.radians((south + north) / 2))
    px_per_deg = (_MAP_WIDTH_PX - 2 * _MAP_MARGIN_PX) / max((east - west) * shrink, (north - south) * 1.6)
    width = (east - west) * shrink * px_per_deg + 2 * _MAP_MARGIN_PX
    height = (north - south) * px_per_deg + 2 * _MAP_MARGIN_PX

    def x(longitude_deg: float) -> float:
        return round(_MAP_MARGIN_PX + (longitude_deg - west) * shrink * px_per_deg, 1)

    def y(latitude_deg: float) -> float:
        return round(_MAP_MARGIN_PX + (north - latitude_deg) * px_per_deg, 1)

    step = _round_step(max(east - west, north - south) / 5)
    return {
        "width": round(width),
        "height": round(height),
        "points": [
            {"key": row["key"], "state": row["final_state"], "x": x(row["longitude_deg"]), "y": y(row["latitude_deg"])}
            for row in placed
        ],
        "parallels": [{"y": y(value), "label": _degrees(value, step, "NS")} for value in _ticks(south, north, step)],
        "meridians": [{"x": x(value), "label": _degrees(value, step, "EW")} for value in _ticks(west, east, step)],
    }


def _span(values: Iterable[float]) -> tuple[float, float]:
    low, high = min(values := list(values)), max(values)
    grow = max(_LEAST_SPAN_DEG - (high - low), 0.06 * (high - low)) / 2
    return low - grow, high + grow


def _round_step(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value)


def _ticks(low: float, high: float, step: float) -> list[float]:
    return [n * step for n in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _degrees(value: float, step: float, signs: str) -> str:
    decimals = max(0, -math.floor(math.log10(step)))
    return f"{abs(value):.{decimals}f}° {signs[0] if value >= 0 else signs[1]}"


def _json_for_script(value: object) -> str:
    """JSON that cannot end the script element it stands in."""
    return json.dumps(value, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("trace_dag.scenario", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["words"] = lambda value: str(value).replace("_", " ") if value else "–"
    environment.filters["mph"] = lambda mps: "–" if mps is None else f"{mps_to_mph(mps):.0f} mph"
    environment.filters["fixed"] = lambda value, digits=2: "–" if value is None else f"{value:.{digits}f}"
    environment.filters["kilobytes"] = lambda size: f"{max(1, round(size / 1024)):,} kB"
    return environment


def _read(name: str) -> str:
    from importlib import resources

    return resources.files("trace_dag.scenario").joinpath("templates", name).read_text(encoding="utf-8")
