"""Replays in a browser: addresses, the keyboard, two agents with one time line, three dimensions."""

from __future__ import annotations

from pathlib import Path

import pytest
import sample_runs

from tests.browser import CHROMIUM, Page
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.replays import replay as replay_of
from trace_dag.agents.replays import replay_with
from trace_dag.agents.stored_cases import AgentRole
from trace_dag.flow.stored_crashes import stored_crash
from trace_dag.flow.workspace import Workspace

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")

CLOCK = "document.getElementById('clock').textContent"
VIEW_BOX = "document.getElementById('scene').getAttribute('viewBox').split(' ').map(Number)"
LINK = "document.getElementById('link').getAttribute('href')"


def press(page: Page, key: str) -> None:
    for kind in ("keyDown", "keyUp"):
        page.send("Input.dispatchKeyEvent", type=kind, key=key, **({"text": key} if len(key) == 1 else {}))


def watch(page: Page, address: str) -> None:
    """Open a replay and wait for its content."""
    page.open(address)
    page.wait("document.getElementById('clock')?.textContent")


@pytest.fixture
def replay() -> str:
    """The address of a replay of a site."""
    return f"{(sample_runs.finished() / 'benchmark/replay.html').as_uri()}?{sample_runs.KEYS[0]}"


def test_an_address_leads_to_a_moment_and_a_view(tmp_path, replay):
    with Page(tmp_path / "profile") as page:
        watch(page, f"{replay}#t=1.25&view=10.0,-20.0,40.0")
        assert page.run(CLOCK).startswith("1.25 s")
        left, top, width, height = page.run(VIEW_BOX)
        assert (left + width / 2, top + height / 2) == pytest.approx((10.0, 20.0)), "y of SVG grows downward"
        assert min(width, height) == pytest.approx(40.0)
        assert page.run(LINK) == "#t=1.25&view=10.0,-20.0,40.0"
        watch(page, f"{replay}#t=0.50&view=impact")
        assert page.run(LINK) == "#t=0.50&view=impact"
        assert page.errors == []


def test_the_keyboard_moves_the_view_and_the_time(tmp_path, replay):
    with Page(tmp_path / "profile") as page:
        watch(page, f"{replay}#t=1.00&view=0.0,0.0,50.0")
        page.run("document.getElementById('scene').focus()")
        press(page, "ArrowRight")
        press(page, "ArrowUp")
        press(page, "+")
        assert page.run(LINK) == "#t=1.00&view=5.0,5.0,40.0"
        page.run("document.activeElement.blur()")
        press(page, "ArrowRight")
        assert page.run(LINK).startswith("#t=1.02&")


def test_another_likely_course_can_be_chosen_by_keyboard_and_by_address(tmp_path, replay):
    solid = "courses.map((each) => Number(each.group.getAttribute('opacity')))"
    best = "Number(document.getElementById('bodies').getAttribute('opacity'))"
    with Page(tmp_path / "profile") as page:
        watch(page, f"{replay}#t=5.00&view=impact")
        assert page.run(best) == 1
        assert page.run(solid) == [0] * 3, "the others are not seen until asked for"
        page.run("document.getElementById('course').focus()")
        press(page, "ArrowDown")
        assert page.run(best) == pytest.approx(0.3)
        assert page.run(solid) == [1, 0, 0]
        assert "&course=1" in page.run(LINK)
        bodies = "courses[0].group.querySelectorAll('g')"
        moved = f"[...{bodies}].map((each) => Number(each.getAttribute('transform').match(/[-0-9.]+/)))"
        logged = "D.courses[0].bodies.map((body) => courses[0].at(body.number, 5).x)"
        assert page.run(moved) == pytest.approx(page.run(logged))
        page.run("show_pane('solid')")
        page.wait(DRAWN)
        for choice, pose in (("2", "courses[1].at"), ("best", "logged")):
            page.run(f"choose_course('{choice}'); line.show(5)")
            for number in page.run("solid.numbers"):
                there = page.run(f"(({{ x, y }}) => [x, y])({pose}({number}, 5))")
                assert page.run(f"solid.place({number}).slice(0, 2)") == pytest.approx(there, abs=0.02), choice
        watch(page, f"{replay}#t=6.00&view=impact&course=all")
        assert page.run(solid) == [0.3] * 3
        assert page.errors == []


def test_the_page_of_a_crash_leads_its_replay_to_a_moment(tmp_path, replay):
    with Page(tmp_path / "profile") as page:
        crash = sample_runs.finished() / f"benchmark/crashes/{sample_runs.KEYS[0]}.html"
        page.open(f"{crash.as_uri()}#t=1.25&view=impact")
        assert page.run("document.querySelector('iframe').src") == f"{replay}#t=1.25&view=impact"


def test_two_agents_are_beside_each_other_with_one_time_line(tmp_path):
    workspace = Workspace.open(sample_runs.finished())
    key, agents = sample_runs.KEYS[0], ["brake", "idm"]
    (tmp_path / "pair.html").write_bytes(replay_with(workspace, key, agents, AgentRole.FIRST, Traffic.RECORDED, "html"))
    inner = "[...document.querySelectorAll('iframe')].map((f) => f.contentDocument.{})"
    with Page(tmp_path / "profile") as page:
        page.open(f"{(tmp_path / 'pair.html').as_uri()}#t=2.00&view=impact")
        assert page.run(inner.format("querySelector('h1').textContent.split(' ')[0]")) == agents
        boxes = inner.format("getElementById('scene').getAttribute('viewBox')")
        page.wait(f"new Set({boxes}).size === 1 && {CLOCK}.startsWith('2.00 s')")
        heads = inner.format("querySelector('#graph line:last-of-type').getAttribute('x1') > 0")
        assert page.run(heads) == [True, True]
        page.run("document.querySelector('iframe').contentDocument.getElementById('scene').focus()")
        size_m = float(page.run(boxes)[0].split()[3])
        press(page, "+")
        page.wait(f"{boxes}.every((box) => Math.abs(box.split(' ')[3] - {0.8 * size_m}) < 0.1)")
        assert page.errors == []


# --- in three dimensions ---------------------------------------------------------------------------------------------
DRAWN = "document.body.dataset.solid === 'drawn'"
REFUSED = "document.getElementById('refused').textContent"


@pytest.mark.parametrize("alone", [True, False], ids=["one file", "page of a site"])
def test_the_crash_is_drawn_in_three_dimensions_on_the_plans_clock(tmp_path, replay, alone):
    if alone:
        workspace = Workspace.open(sample_runs.finished())
        page_alone = tmp_path / "replay.html"
        page_alone.write_bytes(replay_of(stored_crash(workspace, sample_runs.KEYS[0]), "html"))
        replay = page_alone.as_uri()
    with Page(tmp_path / "profile") as page:
        watch(page, f"{replay}#t=1.25&view=impact&pane=solid&from=behind-1")
        page.wait(DRAWN)
        assert page.run(LINK) == "#t=1.25&view=impact&pane=solid&from=behind-1"
        assert page.run("solid.numbers") == page.run("D.vehicles.map((v) => v.number)")
        for t in (0.5, 2.0):
            page.run(f"line.show({t})")
            for number, x, y in page.run(
                f"D.vehicles.map((v) => [v.number, v.x[{round(t * 50)}], v.y[{round(t * 50)}]])"
            ):
                assert page.run(f"solid.place({number}).slice(0, 2)") == pytest.approx([x, y], abs=0.02)
        page.run("solid.canvas.focus()")
        before = page.run("solid.eye()")
        press(page, "d")
        assert page.run("solid.eye()") != before, "the keyboard turns the view"
        # What is asked for is the page and, on a site, the scripts beside it.
        asked = {url for url in page.requests if not url.startswith(("data:", "blob:"))}
        names = {Path(url.partition("#")[0].partition("?")[0]).name for url in asked}
        beside = {f"{sample_runs.KEYS[0]}.js", "replay.js", "replay3d.js"}
        assert names == ({"replay.html"} if alone else {"replay.html"} | beside)
        assert all(url.startswith(("file:", "data:", "blob:")) for url in page.requests)
        assert page.errors == []


def test_the_page_makes_the_same_glb_again_as_is_exported(tmp_path, replay):
    workspace = Workspace.open(sample_runs.finished())
    exported = replay_of(stored_crash(workspace, sample_runs.KEYS[0]), "glb")
    with Page(tmp_path / "profile") as page:
        page.open(f"{replay}#pane=plan")
        page.wait("typeof model === 'function'")
        page.run("model().then((glb) => { window.made = Array.from(new Uint8Array(glb)) }), 0")
        page.wait("window.made !== undefined")
        assert bytes(page.run("window.made")) == exported


def test_without_webgl_the_plan_is_shown_with_a_note(tmp_path, replay):
    with Page(tmp_path / "profile", webgl=False) as page:
        watch(page, f"{replay}#t=1.25&pane=solid")
        page.wait(f"{REFUSED} !== ''")
        assert "cannot draw in three dimensions" in page.run(REFUSED)
        assert page.run("document.getElementById('stage').dataset.pane") == "plan"
        assert page.run("[...document.querySelectorAll('#panes button')].map((b) => b.disabled)") == [False, True, True]
        assert page.run("document.querySelectorAll('#bodies g').length") > 0
        assert page.errors == []


def test_a_missing_replay_is_named(tmp_path, replay):
    with Page(tmp_path / "profile") as page:
        for asked in ("2023-999999", "../secrets", ""):
            page.open(f"{replay.partition('?')[0]}?{asked}")
            page.wait("document.querySelector('h1').textContent.includes('There is no replay')")
            assert not page.run("document.querySelector('main').checkVisibility()")
