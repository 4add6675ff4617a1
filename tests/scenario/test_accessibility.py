"""Pages as people with a keyboard, a screen reader or a small screen meet them: what axe finds, what is cut off.

axe lives with the other judges (``./check`` installs it).
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

import pytest
import sample_runs

from tests.browser import CHROMIUM, Page
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.replays import replay_with
from trace_dag.agents.stored_cases import AgentRole
from trace_dag.agents.summaries import OUTCOMES, write_leaderboard
from trace_dag.flow.workspace import Workspace

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")

VERIFIED, REJECTED_MAP, NO_MAP = "2023-319003", "2023-319069", "2023-319062"
COUNTS = dict.fromkeys(OUTCOMES, 2) | {"agent": "brake", "runs": 10, "cases": 10, "crashes": 5, "crashes_asked": 5}
RUN = {
    "agent": "brake",
    "key": VERIFIED,
    "vehicle_number": 1,
    "role": "struck",
    "part": "responder",
    "outcome": "conflict_avoided",
    "fault": None,
}
PROBABLE = dict.fromkeys(
    ("avoided", "avoided_low", "avoided_high", "stopped", "did_not_arrive", "rules_broken", "mitigated", "worse"), 0.125
) | {
    "agent": "idm",
    "key": VERIFIED,
    "vehicle_number": 1,
    "courses": 8,
}


def axe() -> str:
    judges = Path(os.environ.get("TRACE_DAG_JUDGES", Path(__file__).parents[2] / ".venv-judges"))
    found = next(judges.glob("lib/*/site-packages/axe_playwright_python/axe.min.js"), None)
    if found is None:
        pytest.skip(f"axe is not installed at {judges} (./check installs it)")
    return found.read_text()


@cache
def pages() -> dict[str, Path]:
    """Every kind of page, by its name, in a copy of the root that all tests look at."""
    copy = Path(tempfile.mkdtemp(prefix="trace-dag-tests-"))
    atexit.register(shutil.rmtree, copy, ignore_errors=True)
    folder = sample_runs.copy_finished(copy / "root") / "benchmark"
    row = COUNTS | {
        "delta_v_saved_rel": 0.4,
        "off_road": 0,
        "unfinished": 1,
        "split": "test",
        "traffic": "persistent",
        "handed_in": True,
        "wrong_way": 0,
        "max_deceleration_median_mps2": 7.5,
        "dimension": "kind",
        "class": "two_vehicles",
    }
    run = RUN | {"delta_v_mps": None, "recorded_delta_v_mps": 9.0}
    (folder / "leaderboard-filled.html").write_bytes(write_leaderboard([run], [row], [row], [PROBABLE]))
    pair = replay_with(
        Workspace.open(sample_runs.finished()), VERIFIED, ["brake", "idm"], AgentRole.FIRST, Traffic.RECORDED, "html"
    )
    (folder / "pair.html").write_bytes(pair)
    return {
        "index": folder / "index.html",
        "verified": folder / f"crashes/{VERIFIED}.html",
        "rejected map": folder / f"crashes/{REJECTED_MAP}.html",
        "no map": folder / f"crashes/{NO_MAP}.html",
        "replay": folder / "replay.html",
        "two agents": folder / "pair.html",
        "leaderboard": folder / "leaderboard-filled.html",
    }


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Page(tmp_path_factory.mktemp("browser") / "profile") as page:
        yield page


NAMES = ("index", "verified", "rejected map", "no map", "replay", "two agents", "leaderboard")
FOUND = """
axe.run(document, { preload: false }).then(
  (found) => { window.found = found.violations.map((each) => `${each.id}: ${each.nodes.map((node) => node.target)}`); },
  (error) => { window.found = [String(error)]; }); 0
"""  # style sheets are not read again, which pages opened as files may not do
BEYOND_THE_TAB_KEY = """
[...document.querySelectorAll('a[href], button, select, input, summary, [role=button], .scroll, #scene')]
  .filter((each) => each.checkVisibility() && each.tabIndex < 0).map((each) => each.outerHTML)
"""


def visit(page: Page, name: str) -> None:
    """Open a page, and wait for a replay's content."""
    page.open(pages()[name].as_uri() + (f"?{VERIFIED}" if name == "replay" else ""))
    if name == "replay":
        page.wait("document.getElementById('clock')?.textContent")


def resize(page: Page, width_px: int) -> None:
    page.send(
        "Emulation.setDeviceMetricsOverride", width=width_px, height=900, deviceScaleFactor=1, mobile=width_px < 600
    )


def prefer(page: Page, scheme: str) -> None:
    page.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])


@pytest.mark.parametrize("name", NAMES)
def test_axe_finds_nothing_in_light_and_dark(browser, name):
    resize(browser, 1280)
    visit(browser, name)
    browser.run(f"{axe()}; 0")
    for scheme in ("light", "dark"):
        prefer(browser, scheme)
        browser.run(f"window.found = undefined; {FOUND}")
        browser.wait("window.found !== undefined")
        assert browser.run("window.found") == [], scheme


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_whole_on_a_screen_and_a_phone_by_keyboard_and_in_the_dark(browser, name):
    prefer(browser, "dark")
    visit(browser, name)
    for width_px in (390, 1280):
        resize(browser, width_px)
        assert browser.run("document.documentElement.scrollWidth") <= width_px, "nothing is cut off"
        assert browser.run(BEYOND_THE_TAB_KEY) == []
    colour = "getComputedStyle(document.body).backgroundColor.match(/[0-9]+/g).map(Number)"
    assert max(browser.run(colour)) < 64


def test_filters_are_folded_on_a_phone_alone(browser):
    for width_px, unfolded in ((390, False), (1280, True)):
        resize(browser, width_px)
        visit(browser, "index")
        assert browser.run("document.querySelector('.filters').checkVisibility()") is unfolded
