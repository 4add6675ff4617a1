"""The benchmark page: a static site that opens from a file, without a server, a CDN or a request leaving it.

An index (funnel, coverage beside the published counts, a map of all crashes, filters, a table) and a page per crash
(summary, facts, picture, replay, states, every criterion, downloads). Everything shown comes from the warehouse's rows
and the artefacts; nothing is computed here. All text is escaped by the templates: reports
and maps are untrusted.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from trace_dag import __version__
from trace_dag.crash.parties import is_vehicle, party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import place_in_words
from trace_dag.osm.rights import Rights
from trace_dag.roads.report import MapReport
from trace_dag.states.types import StateEstimate
from trace_dag.units import mps_to_mph
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from jinja2 import Environment

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Download:
    """A file offered on a crash's page; ``href`` is relative to that page."""

    label: str
    href: str
    size_bytes: int


@dataclass(frozen=True, eq=False)
class CrashPage:
    """What one crash's page shows: ``crash`` is its row of the ``crashes`` table, ``rights`` those of its map. Paths
    are relative to the page."""

    crash: Row
    outcomes: Sequence[Row]
    rights: Rights
    record: CrashRecord | None = None
    map_report: MapReport | None = None
    estimate: StateEstimate | None = None
    verdict: Verdict | None = None
    picture: str | None = None
    replay: str | None = None
    downloads: Sequence[Download] = ()


def write_index(
    crashes: Sequence[Row],
    funnel: Sequence[Row],
    coverage: Sequence[Row],
    failure_reasons: Sequence[Row],
    rights: Rights,
) -> bytes:
    """``index.html`` from the rows of the warehouse's tables of the same names; ``rights`` of all crashes' maps."""
    page = (
        _templates()
        .get_template("site_index.html.jinja")
        .render(
            version=__version__,
            rights=rights,
            kind="fictional" if rights.fictional else "fatal",
            total=len(crashes),
            crashes_json=_json_for_script(_columns_of(crashes)),
            columns=_TABLE_COLUMNS,
            filters=_filters(crashes),
            funnel=funnel,
            largest=max((row["crashes"] for row in funnel), default=1) or 1,
            coverage=_by_dimension(coverage),
            failure_reasons=failure_reasons,
            counts={state: sum(row["final_state"] == state for row in crashes) for state in _FINAL_STATES},
        )
    )
    return page.encode()


def write_crash_page(page: CrashPage) -> bytes:
    """The page of one crash, ``crashes/<key>.html`` of the site."""
    template = _templates().get_template("site_crash.html.jinja")
    return template.render(
        page=page,
        rights=page.rights,
        facts=_facts(page.crash),
        picture_alt=_picture_alt(page),
        version=__version__,
    ).encode()


def static_files() -> dict[str, bytes]:
    """Style and script of the site by name."""
    return {name: _read(name).encode() for name in ("site.css", "site.js", "site_map.js")}


def _facts(crash: Row) -> list[tuple[str, str]]:
    """What the report says of the crash as a whole, the parts it says."""
    date = "-".join(f"{crash[part]:02d}" for part in ("year", "month", "day") if crash.get(part) is not None)
    hour = f", {crash['hour']:02d} h local time" if crash.get("hour") is not None else ""
    position = ""
    if crash.get("latitude_deg") is not None:
        position = f"{crash['latitude_deg']:.6f}, {crash['longitude_deg']:.6f}"
    facts = {
        "Place": crash.get("place") or crash.get("state_name"),
        "Date": date + hour,
        "Reported position (WGS84)": position,
        "Roads": " and ".join(name for column in ("trafficway_1", "trafficway_2") if (name := crash.get(column))),
        "Kind of crash": _words(crash.get("kind")),
        "Collision type": _words(crash.get("collision_type")),
        "Road topology": _words(crash.get("road_topology")),
        "Vehicle trajectory": _words(crash.get("vehicle_trajectory")),
        "Vehicles": crash.get("vehicles"),
        "Persons killed": crash.get("fatalities"),
        "Cohort": crash.get("cohort"),
    }
    return [(label, str(value)) for label, value in facts.items() if value not in (None, "")]


def _picture_alt(page: CrashPage) -> str:
    drawn = "The road with its lanes seen from above, with the reported point"
    if page.estimate is None:
        return f"{drawn}."
    vehicles = ", ".join(
        f"vehicle {each.vehicle_number} ({_words(each.manoeuvre)})" for each in page.estimate.hypotheses[0].participants
    )
    return f"{drawn}, and the paths and bodies at contact and at rest of {vehicles}."


def _words(value: object) -> str:
    return str(value).replace("_", " ") if value else ""


def _party(number: int | None) -> str:
    """``V2``, ``person 1``: a party as tables name it."""
    if number is None:
        return "–"
    return f"V{number}" if is_vehicle(number) else party_in_words(number)


def _fixed(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before a zero


def _holds(passed: bool | None, threshold: float | None) -> str:
    if passed is None:
        return "reported only" if threshold is None else "not evaluated"
    return "yes" if passed else "no"


_FINAL_STATES = ("verified", "rejected", "failed", "pending")
_FILTERS = {
    "final_state": "Outcome",
    "grade": "Grade",
    "kind": "Kind of crash",
    "collision_type": "Collision type",
    "road_topology": "Road topology",
    "vehicle_trajectory": "Vehicle trajectory",
    "state_name": "State",
    "cohort": "Cohort",
    "reason": "Reason",
    "outdated": "Outdated",
}
_TABLE_COLUMNS = (
    {"name": "key", "label": "Crash", "class": "", "sorted": True},
    {"name": "final_state", "label": "Outcome", "class": "", "sorted": False},
    {"name": "grade", "label": "Grade", "class": "", "sorted": False},
    {"name": "reason", "label": "Reason", "class": "", "sorted": False},
    {"name": "place", "label": "Place", "class": "wide", "sorted": False},
    {"name": "kind", "label": "Kind", "class": "", "sorted": False},
    {"name": "collision_type", "label": "Collision", "class": "", "sorted": False},
    {"name": "road_topology", "label": "Topology", "class": "wide", "sorted": False},
    {"name": "vehicle_trajectory", "label": "Trajectory", "class": "wide", "sorted": False},
    {"name": "contact_distance_m", "label": "Contact (m)", "class": "number", "sorted": False},
)
# Decimals: 5 of a degree are a metre.
_NUMBERS = {"latitude_deg": 5, "longitude_deg": 5, "contact_distance_m": 2}


def _columns_of(crashes: Sequence[Row]) -> dict[str, Any]:
    """The crashes by column, each text once: a fraction of the size of one object per crash."""
    coded = {}
    for name in (*_FILTERS, "place"):
        numbers: dict[Any, int] = {}
        codes = [numbers.setdefault(crash.get(name) or None, len(numbers)) for crash in crashes]
        coded[name] = {"values": list(numbers), "codes": codes}
    plain = {
        name: [None if (value := crash.get(name)) is None else round(value, digits) for crash in crashes]
        for name, digits in _NUMBERS.items()
    }
    return {"key": [crash["key"] for crash in crashes], "coded": coded, "plain": plain}


def _filters(crashes: Sequence[Row]) -> list[dict[str, Any]]:
    filters = []
    for name, label in _FILTERS.items():
        values = sorted({str(crash[name]) for crash in crashes if crash.get(name)})
        if values:
            filters.append({"name": name, "label": label, "values": values})
    return filters


def _by_dimension(coverage: Sequence[Row]) -> dict[str, list[Row]]:
    dimensions: dict[str, list[Row]] = {}
    for row in coverage:
        dimensions.setdefault(str(row["dimension"]), []).append(row)
    return dimensions


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
    environment.filters["words"] = lambda value: _words(value) or "–"
    environment.filters["holds"] = _holds
    environment.filters["party"] = _party
    environment.filters["place"] = place_in_words
    environment.filters["mph"] = lambda mps: "–" if mps is None else f"{mps_to_mph(mps):.0f} mph"
    environment.filters["fixed"] = _fixed
    environment.filters["unit"] = lambda unit: "m/s" if unit == "mps" else unit
    environment.filters["kilobytes"] = lambda size: f"{max(1, round(size / 1024)):,} kB"
    return environment


def _read(name: str) -> str:
    from importlib import resources

    return resources.files("trace_dag.scenario").joinpath("templates", name).read_text(encoding="utf-8")
