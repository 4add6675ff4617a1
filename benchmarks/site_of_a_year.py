"""The benchmark page with a year of crashes: its size, and how long it takes to open, to filter and to search.

``python -m benchmarks.site_of_a_year [CRASHES]``: made-up crashes of all states, kinds and outcomes, in headless
Chromium, from a file. Times are wall time of the page's own clock, medians of several turns.
"""

from __future__ import annotations

import random
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.browser import Page
from trace_dag.osm.rights import OSM_ATTRIBUTION, Rights
from trace_dag.scenario.site import IndexRows, static_files, write_index

CRASHES = 36_000
_TOWNS_OF_A_STATE = 160  # of 56: FARS 2015 has 7,769 different cities and counties in its 32,166 crashes
_TURNS = 7
_OPEN_MOST_S, _ANSWER_MOST_S, _MOST_BYTES = 2.0, 0.1, 3_000_000
_KINDS = ("two_vehicles", "fixed_object", "pedestrian", "overturn", "several_vehicles", "cyclist", "parked_vehicle")
_REASONS = ("crash_off_road", "map_distorted", "incomplete_trajectory", "not_modelled", "wrong_impact")
_TYPES = ("angle", "front_to_rear", "front_to_front", "sideswipe_same_direction", "others")


def made_up(crashes: int) -> list[dict[str, Any]]:
    """Rows as the warehouse's table ``crashes`` has them, the same every time."""
    draw = random.Random(1)
    rows = []
    for number in range(crashes):
        state = 1 + number * 56 // crashes
        town, verified = draw.randrange(_TOWNS_OF_A_STATE), draw.random() < 0.5
        rows.append(
            {
                "key": f"2023-{10_000 * state + number % 10_000}",
                "final_state": "verified" if verified else "rejected",
                "grade": draw.choice(("corroborated", "consistent")) if verified else None,
                "kind": draw.choice(_KINDS),
                "collision_type": draw.choice(_TYPES),
                "road_topology": draw.choice(("four_way", "t", "non_intersection")),
                "vehicle_trajectory": draw.choice(("straight", "turning", "intersecting")),
                "state_name": f"State {state}",
                "cohort": "2023",
                "reason": None if verified else draw.choice(_REASONS),
                "outdated": None,
                "place": f"Town {town}, County {town // 3}, State {state}",
                "latitude_deg": draw.uniform(25.0, 49.0),
                "longitude_deg": draw.uniform(-124.0, -67.0),
                "contact_distance_m": draw.uniform(0.0, 9.0) if verified else None,
            }
        )
    return rows


def main() -> int:
    """Print the figures; exit code 1 if a goal is missed."""
    crashes = int(sys.argv[1]) if sys.argv[1:] else CRASHES
    with tempfile.TemporaryDirectory() as folder:
        rows = made_up(crashes)
        files = {"index.html": write_index(IndexRows(rows, [], [], [], [], False), Rights.of([OSM_ATTRIBUTION]))}
        files |= static_files()
        for name, data in files.items():
            (Path(folder) / name).write_bytes(data)
        loaded = [name for name in files if name == "index.html" or f'"{name}"'.encode() in files["index.html"]]
        size = sum(len(files[name]) for name in loaded)
        with Page(Path(folder) / "profile") as page:
            opened, filtered, searched = zip(
                *(_turn(page, Path(folder) / "index.html") for _ in range(_TURNS)), strict=True
            )
    print(f"{crashes} crashes, medians of {_TURNS} turns")
    figures = (
        ("size with what it loads", size / 1e6, "MB", _MOST_BYTES / 1e6),
        ("opening", statistics.median(opened), "s", _OPEN_MOST_S),
        ("filtering", statistics.median(filtered), "s", _ANSWER_MOST_S),
        ("searching", statistics.median(searched), "s", _ANSWER_MOST_S),
    )
    for name, value, unit, most in figures:
        print(f"{name:30} {value:8.3f} {unit:3} goal {most:g} {'reached' if value <= most else 'MISSED'}")
    return 1 if any(value > most for _, value, _, most in figures) else 0


def _turn(page: Page, file: Path) -> tuple[float, float, float]:
    """Seconds of opening, of filtering and of searching, each until what is shown has been laid out."""
    page.open(file.as_uri())
    opened_ms = page.run("performance.getEntriesByType('navigation')[0].loadEventEnd")
    return opened_ms / 1e3, _answer(page, "state_name", "State 7"), _answer(page, "search", "town 77")


def _answer(page: Page, field: str, value: str) -> float:
    taken_ms = page.run(
        "(() => { const began = performance.now();"
        f" const field = document.querySelector('[name={field}]'); field.value = '{value}';"
        " field.dispatchEvent(new Event('input', {bubbles: true})); document.body.offsetHeight;"
        " return performance.now() - began; })()"
    )
    return float(taken_ms) / 1e3


if __name__ == "__main__":
    sys.exit(main())
