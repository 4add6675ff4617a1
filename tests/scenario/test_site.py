"""The benchmark page: what it shows, that it shows text as text, and how it behaves in a browser."""

from __future__ import annotations

import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
import sample_runs

from tests.browser import CHROMIUM, Page
from tests.scenario.page_rows import crash
from trace_dag.crash.summary import TOPOLOGIES
from trace_dag.osm.types import OSM_ATTRIBUTION, Rights
from trace_dag.pages.crash_page import CrashPage, write_crash_page
from trace_dag.pages.site import IndexRows, static_files, write_index
from trace_dag.warehouse.query import rows

EVIL = """</script><script>alert("1")</script>'&"""
RIGHTS = Rights.of([f"{OSM_ATTRIBUTION} {EVIL}"])
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


def index(crashes: list[dict[str, Any]]) -> bytes:
    funnel = [{"step": "registered", "crashes": len(crashes), "published": 100}]
    coverage = [{"dimension": "collision_type", "class": "angle", "registered": 4, "verified": 0, "published": 19}]
    reasons = [{"stage": "road_map", "reason": EVIL, "published_category": "not in the paper", "crashes": 1}]
    moving = [row | {"sketched": False} for row in crashes[:50]]
    return write_index(IndexRows(crashes, moving, funnel, coverage, reasons, leaderboard=True), RIGHTS)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An index of 2,000 crashes, one of them with hostile text, and the page of that one."""
    folder = tmp_path_factory.mktemp("site")
    crashes = [
        crash(number)
        | {
            "signalised": number % 11 == 4,
            "surface": "wet" if number % 2 else "dry",
            "pre_crash_scenario": "turning at non-signalised junctions",
        }
        for number in range(2000)
    ]
    crashes[0] |= {"place": EVIL, "cohort": EVIL}
    (folder / "index.html").write_bytes(index(crashes))
    (folder / "crashes").mkdir()
    (folder / f"crashes/{crashes[0]['key']}.html").write_bytes(write_crash_page(CrashPage(crashes[0], (), RIGHTS)))
    (folder / "thumbnails").mkdir()
    for each in crashes:
        (folder / f"thumbnails/{each['key']}.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    for name, data in static_files().items():
        (folder / name).write_bytes(data)
    return folder


def test_pages_say_whether_their_crashes_have_happened():
    fictional = Rights.of(["fictional, CC0"])
    for rights, is_fiction in ((RIGHTS, False), (fictional, True), (Rights.of([*RIGHTS.attributions, "CC0"]), False)):
        pages = (
            write_crash_page(CrashPage(crash(0), (), rights)),
            write_index(IndexRows([crash(0)], [], [], [], [], leaderboard=False), rights),
        )
        for page in map(bytes.decode, pages):
            assert ("happened" in page) is is_fiction
            assert ("NHTSA" in page) is not is_fiction
            assert ("OpenStreetMap" in page) is not is_fiction


def test_the_gallery_shows_each_class_before_a_second_of_one():
    crashes = [crash(number) | {"collision_type": "angle"} for number in range(20)]
    crashes[19] |= {"collision_type": "front_to_rear"}
    page = index(crashes).decode()
    shown = re.findall(r'src="thumbnails/([\d-]+)\.svg"', page)
    assert shown[:2] == [crashes[0]["key"], crashes[19]["key"]]
    assert len(shown) == len(set(shown)) == 8


def test_the_leaderboard_is_linked_once_an_agent_has_driven():
    for driven in (True, False):
        page = write_index(IndexRows([crash(0)], [], [], [], [], leaderboard=driven), RIGHTS)
        assert (b"leaderboard.html" in page) is driven


def test_two_thousand_crashes_stay_a_small_page(site):
    assert (site / "index.html").stat().st_size < 250_000


def test_text_of_reports_stays_text(site):
    for page in (site / "index.html", site / "crashes/2023-510001.html"):
        assert "alert(" in page.read_text()
        assert "<script>alert" not in page.read_text()


def test_numbers_on_the_page_are_those_of_the_tables():
    root = sample_runs.finished()
    page = (root / "benchmark/index.html").read_text()
    warehouse = root / "warehouse.duckdb"
    for row in rows(warehouse, "funnel"):
        step, crashes = row["step"], row["crashes"]
        assert re.search(rf'<th scope="row">{step}</th><td class="number">{crashes}</td>', page), row
    for row in rows(warehouse, "coverage"):
        cells = "".join(f'<td class="number">{row[name]}</td>' for name in ("verified", "registered", "published"))
        name = {**TOPOLOGIES, "others": "other"}.get(row["class"], row["class"].replace("_", " "))
        assert re.search(rf">{name}(</a>)?[\s<].*?{cells}", page, re.DOTALL), row
    data = json.loads(re.search(r'id="crashes-data">(.*?)</script>', page, re.DOTALL).group(1))
    states = data["coded"]["final_state"]
    shown = {key: states["values"][code] for key, code in zip(data["key"], states["codes"], strict=True)}
    assert shown == {row["key"]: row["final_state"] for row in rows(warehouse, "crashes")}


def test_every_crash_has_a_page_and_every_link_of_a_page_leads_somewhere():
    folder = sample_runs.finished() / "benchmark"
    assert {path.stem for path in (folder / "crashes").glob("*.html")} == set(sample_runs.KEYS)
    for page in [folder / "index.html", *(folder / "crashes").glob("*.html")]:
        for link in re.findall(r'(?:href|src)="([^"#][^"]*)"', page.read_text()):
            file, _, key = link.partition("?")
            assert link.startswith("data:") or (page.parent / file).resolve().is_file(), (page, link)
            assert not key or (folder / f"replays/{key}.js").is_file(), (page, link)


def test_a_rejected_crash_can_be_watched_as_far_as_it_got():
    """Pages of crashes that are not verified offer map, verdict and replay where there are any, and no package."""
    folder = sample_runs.finished() / "benchmark"
    tables = sample_runs.finished() / "warehouse.duckdb"
    simulated = {row["key"] for row in rows(tables, "simulations")}
    mapped = {row["key"] for row in rows(tables, "maps")}
    unverified = {row["key"] for row in rows(tables, "crashes") if row["final_state"] == "rejected"}
    assert unverified & simulated
    assert unverified - mapped
    for key in unverified:
        page = (folder / "crashes" / f"{key}.html").read_text()
        links = re.findall(r'href="(?:\.\./)+(\w+)/([^"]+)"', page)
        assert (f'href="../replay.html?{key}"' in page) == (key in simulated)
        assert (("road_map", f"{key}.xodr") in links) == (key in mapped)
        assert "packages" not in {place for place, _ in links}


def test_contrasts_are_those_of_wcag_aa():
    """Text 4.5 to 1 on every ground it stands on, by the formula of WCAG 2.2, in light and dark."""
    css = static_files()["site.css"].decode()
    light, dark = (
        dict(re.findall(r"--(\w+): (#\w{6})", block)) for block in re.findall(r":root \{(.*?)\}", css, re.DOTALL)
    )

    def luminance(colour: str) -> float:
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    for scheme in (light, dark):
        for text in ("ink", "muted", "accent", "verified", "rejected", "failed", "pending"):
            for ground in ("ground", "panel"):
                high, low = sorted((luminance(scheme[text]), luminance(scheme[ground])), reverse=True)
                assert (high + 0.05) / (low + 0.05) >= 4.5, (text, ground)


@needs_chromium
@pytest.mark.parametrize("width_px", [1280, 390])
def test_in_a_browser_filters_choose_and_nothing_leaves_the_page(site, tmp_path, width_px):
    count = "document.getElementById('count').textContent"
    rows_shown = "document.querySelectorAll('#crashes tbody tr').length"
    choose = (
        "(() => {{ const field = document.querySelector('[name={}]'); field.value = '{}';"
        " field.dispatchEvent(new Event('input', {{bubbles: true}})); }})()"
    )
    with Page(tmp_path / "profile", width_px=width_px) as page:
        page.open((site / "index.html").as_uri())
        assert page.run(count) == "2,000 of 2,000 crashes"
        assert page.run("document.documentElement.scrollWidth") <= width_px
        assert page.run("document.querySelectorAll('#map .cluster, #map a').length") > 5
        states = page.run("[...document.querySelectorAll('#crashes .state')].map(each => each.textContent)")
        assert states[0] == "verified", "which come first"
        page.run(choose.format("collision_type", "angle"))
        assert page.run(count) == f"{sum(n % 3 == 0 for n in range(2000))} of 2,000 crashes"
        page.run(choose.format("final_state", "rejected"))
        both = sum(n % 3 == 0 and n % 5 == 2 for n in range(2000))
        assert page.run(count) == f"{both} of 2,000 crashes"
        assert page.run("location.hash") == "#final_state=rejected&collision_type=angle"
        assert page.run(rows_shown) == 25
        page.run("document.getElementById('more').click()")
        assert page.run(rows_shown) == 50
        page.run("document.querySelector('[data-column=contact_distance_m]').click()")
        page.run("document.querySelector('[data-column=contact_distance_m]').click()")
        last = max(n for n in range(2000) if n % 3 == 0 and n % 5 == 2)
        assert page.run("document.querySelector('#crashes tbody a').textContent") == f"2023-{510001 + last}"
        page.run("document.getElementById('reset').click()")
        assert page.run(count) == "2,000 of 2,000 crashes"
        page.run(choose.format("search", "town 3"))
        assert page.run(count) == f"{sum(n % 7 == 3 for n in range(2000))} of 2,000 crashes"
        page.run(choose.format("search", "wet signalised"))
        assert page.run(count) == f"{sum(n % 11 == 4 and n % 2 for n in range(2000))} of 2,000 crashes"
        page.open((site / "crashes/2023-510001.html").as_uri())
        assert page.run("document.querySelector('dl').textContent.includes('alert(')")
        assert page.run("document.documentElement.scrollWidth") <= width_px
        assert page.errors == []
        assert all(url.startswith(("file:", "data:", "about:")) for url in page.requests)


@needs_chromium
@pytest.mark.parametrize("width_px", [1280, 390])
def test_in_a_browser_no_ring_of_the_map_covers_another(site, tmp_path, width_px):
    with Page(tmp_path / "profile", width_px=width_px) as page:
        page.open((site / "index.html").as_uri())
        rings = page.run(
            "[...document.querySelectorAll('#map .cluster')].map((ring) => {"
            " const at = ring.transform.baseVal[0].matrix;"
            " return [at.e, at.f, +ring.querySelector('.disc').getAttribute('r')]; })"
        )
        assert len(rings) > 3
        for (x, y, radius), (x_2, y_2, radius_2) in itertools.combinations(rings, 2):
            assert math.hypot(x - x_2, y - y_2) >= radius + radius_2


@needs_chromium
def test_in_a_browser_a_ring_of_the_map_opens_with_the_keyboard(site, tmp_path):
    with Page(tmp_path / "profile") as page:
        page.open((site / "index.html").as_uri())
        numbers = "[...document.querySelectorAll('#map .cluster text:first-of-type')].map((t) => +t.textContent)"
        before = page.run(f"Math.max(...{numbers})")
        page.run(
            "document.querySelector('#map .cluster').dispatchEvent("
            "new KeyboardEvent('keydown', {key: 'Enter', bubbles: true}))"
        )
        assert page.run(f"Math.max(...{numbers}, 1)") < before
        assert page.errors == []


@needs_chromium
def test_in_a_browser_the_page_of_a_crash_plays_its_replay(tmp_path):
    verified = next(
        row["key"]
        for row in rows(sample_runs.finished() / "warehouse.duckdb", "crashes")
        if row["final_state"] in ("verified", "first_event_only")
    )
    with Page(tmp_path / "profile") as page:
        page.open((sample_runs.finished() / f"benchmark/crashes/{verified}.html").as_uri())
        page.run("document.querySelector('iframe').scrollIntoView()")
        page.wait("document.querySelector('img').complete && document.querySelector('img').naturalWidth > 0")
        page.open(f"{(sample_runs.finished() / 'benchmark/replay.html').as_uri()}?{verified}")
        page.wait("document.getElementById('clock')?.textContent")
        clock = "document.body.innerText.match(/([0-9.]+) s/)[1]"
        before = page.run(clock)
        page.run("[...document.querySelectorAll('button')].find((b) => /Play/.test(b.textContent)).click()")
        page.wait(f"{clock} != '{before}'")
        page.run("[...document.querySelectorAll('button')].find((b) => /Pause/.test(b.textContent)).click()")
        before = float(page.run(clock))
        page.run("document.getElementById('time').focus()")
        for kind in ("keyDown", "keyUp"):
            page.send(
                "Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39
            )
        assert float(page.run(clock)) == pytest.approx(before + 0.02, abs=0.011), "a step is seen on the clock"
        assert page.errors == []
        assert all(url.startswith(("file:", "data:", "about:", "blob:")) for url in page.requests)


@needs_chromium
def test_in_a_browser_a_replay_waits_for_room(tmp_path):
    key = next((sample_runs.finished() / "benchmark/replays").glob("*.js")).stem
    address = f"{(sample_runs.finished() / 'benchmark/replay.html').as_uri()}?{key}"
    with Page(tmp_path / "profile") as page:
        (tmp_path / "frame.html").write_text(f"<iframe hidden src='{address}'></iframe>")
        page.open((tmp_path / "frame.html").as_uri())
        page.run("document.querySelector('iframe').hidden = false")
        assert page.errors == []
