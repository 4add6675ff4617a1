"""The benchmark page: a static site that opens from a file, without a server, a CDN or a request leaving it.

Here is its index: funnel, coverage beside the published counts, a map of all crashes, filters, a table. Everything
shown comes from the warehouse's rows; nothing is computed here. Each crash has a page of its own (``crash_page``).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from trace_dag.osm.types import Rights
from trace_dag.pages.crash_page import LABEL_MEANINGS, report_rights
from trace_dag.pages.page_templates import NAMES, read, render
from trace_dag.pages.replay import LIBRARY, site_files
from trace_dag.verdict.types import Label

Row = Mapping[str, Any]


_GALLERY = 8


@dataclass(frozen=True)
class IndexRows:
    """The rows of the index, from the warehouse's tables of the same names.

    ``moving``: crashes with a thumbnail, ``sketched`` if they have a sketch, else a picture; ``leaderboard``: whether
    an agent has driven.
    """

    crashes: Sequence[Row]
    moving: Sequence[Row]
    funnel: Sequence[Row]
    coverage: Sequence[Row]
    failure_reasons: Sequence[Row]
    leaderboard: bool


def write_index(rows: IndexRows, rights: Rights) -> bytes:
    """Return ``index.html``; ``rights`` are those of all crashes' maps."""
    crashes, funnel = rows.crashes, rows.funnel
    return render(
        "site_index.html.jinja",
        rights=rights,
        kind="fictional " if rights.fictional else "",
        reports=sorted({report_rights(crash) for crash in crashes}),
        total=len(crashes),
        crashes_json=_json_for_script(_columns_of(crashes)),
        columns=_TABLE_COLUMNS,
        filters=_filters(crashes),
        funnel=funnel,
        largest=max((row["crashes"] for row in funnel), default=1) or 1,
        gallery=_varied(rows.moving, _GALLERY),
        leaderboard=rows.leaderboard,
        coverage=_by_dimension(rows.coverage),
        failure_reasons=rows.failure_reasons,
        counts={state: sum(row["final_state"] == state for row in crashes) for state in _FINAL_STATES},
        meanings=_MEANINGS,
    )


def _varied(crashes: Sequence[Row], most: int) -> list[Row]:
    """Return a varied selection of crashes: one of each kind and collision type, then a second of each, and so on."""
    turn: Counter[tuple[Any, Any]] = Counter()
    order = []
    for crash in crashes:
        of_its_class = (crash.get("kind"), crash.get("collision_type"))
        order.append(turn[of_its_class])
        turn[of_its_class] += 1
    chosen = sorted(range(len(crashes)), key=lambda at: order[at])[:most]
    return [crashes[at] for at in chosen]


def static_files() -> dict[str, bytes]:
    """Return the files that are the same on every site, by name: style, scripts, and the page of all replays."""
    files = {name: read(name) for name in ("site.css", "site.js", "site_map.js", "site_states.js", LIBRARY)}
    return {name: text.encode() for name, text in files.items()} | site_files()


_FINAL_STATES = ("verified", "first_event_only", "rejected", "failed", "pending")
_MEANINGS: Mapping[str, str] = {
    **LABEL_MEANINGS,
    Label.REJECTED: "the report, the map or the simulation does not bear it out; the reason is beside it",
    "failed": "the program or a service broke off; run it again",
    "pending": "not run to its end yet",
}
_FILTERS = {
    "final_state": "Outcome",
    "grade": "Grade",
    "kind": "Kind of crash",
    "collision_type": "Collision type",
    "road_topology": "Road topology",
    "vehicle_trajectory": "Vehicle trajectory",
    "vehicle_classes": "Vehicle class",
    "month": "Month",
    "pre_crash_scenario": "Pre-crash scenario",
    "light": "Light",
    "weather": "Weather",
    "speed_limit_mph": "Speed limit (mph)",
    "state_name": "State",
    "cohort": "Register (cohort)",
    "reason": "Reason",
    "outdated": "Outdated",
}
_TABLE_COLUMNS = (
    {"name": "key", "label": "Crash", "class": "", "sorted": False},
    {"name": "final_state", "label": "Outcome", "class": "", "sorted": True},
    {"name": "grade", "label": "Grade", "class": "wide", "sorted": False},
    {"name": "reason", "label": "Reason", "class": "", "sorted": False},
    {"name": "place", "label": "Place", "class": "wide", "sorted": False},
    {"name": "kind", "label": "Kind", "class": "", "sorted": False},
    {"name": "collision_type", "label": "Collision", "class": "wide", "sorted": False},
    {"name": "road_topology", "label": "Topology", "class": "wide", "sorted": False},
    {"name": "vehicle_trajectory", "label": "Trajectory", "class": "wide", "sorted": False},
    {"name": "contact_distance_m", "label": "Contact off, ft (m)", "class": "wide number", "sorted": False},
)
_SEARCHED = ("place", "trafficway_1", "trafficway_2", "surface", "signalised", "person_types", "euro_ncap", "odd")
# Decimals: 5 of a degree are a metre.
_NUMBERS = {"latitude_deg": 5, "longitude_deg": 5, "contact_distance_m": 2}


def _text_of(crash: Row, name: str) -> str | None:
    """Return the text for a crash in a column of the list; months with their year, limits in whole mph."""
    value = crash.get(name)
    if value is None or value == "":
        return None
    if name == "month":
        return f"{crash['year']}-{value:02d}"
    if name == "signalised":
        return name if value else None
    return f"{value:.0f}" if name == "speed_limit_mph" else str(value)


def _columns_of(crashes: Sequence[Row]) -> dict[str, Any]:
    """Return the crashes by column, with each text once, which is much smaller than one object per crash."""
    coded = {}
    for name in (*_FILTERS, *_SEARCHED):
        numbers: dict[Any, int] = {}
        codes = [numbers.setdefault(_text_of(crash, name), len(numbers)) for crash in crashes]
        coded[name] = {"values": list(numbers), "codes": codes}
    plain = {
        name: [None if (value := crash.get(name)) is None else round(value, digits) for crash in crashes]
        for name, digits in _NUMBERS.items()
    }
    return {"key": [crash["key"] for crash in crashes], "coded": coded, "plain": plain, "words": NAMES}


def _filters(crashes: Sequence[Row]) -> list[dict[str, Any]]:
    filters = []
    for name, label in _FILTERS.items():
        texts = {text for crash in crashes if (text := _text_of(crash, name))}
        if name == "vehicle_classes":
            texts = {each for text in texts for each in text.split(", ")}
        values = sorted(texts, key=lambda text: (int(text) if text.isdigit() else 0, text))
        if values:
            filters.append({"name": name, "label": label, "values": values})
    return filters


def _by_dimension(coverage: Sequence[Row]) -> dict[str, list[Row]]:
    dimensions: dict[str, list[Row]] = {}
    for row in coverage:
        dimensions.setdefault(str(row["dimension"]), []).append(row)
    return dimensions


def _json_for_script(value: object) -> str:
    """Return JSON that cannot end its script element."""
    return json.dumps(value, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")
