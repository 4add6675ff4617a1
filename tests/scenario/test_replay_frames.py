"""What people see of a crash when they open its replay: everybody, whole, with nothing in front."""

from __future__ import annotations

import pytest
import sample_runs
from browser import CHROMIUM, Page
from scenario.replay_frames import seen_parties

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
VERIFIED = ("2023-319003", "2023-319022", "2023-319024")


def address(key: str) -> str:
    return f"{(sample_runs.finished() / 'benchmark/replay.html').as_uri()}?{key}"


def test_everybody_is_in_the_picture_at_first_at_the_contact_and_in_the_end(tmp_path):
    with Page(tmp_path / "profile") as page:
        for key in VERIFIED:
            for party in seen_parties(page, address(key), key):
                assert party.inside, party
                assert not party.covered, party
                assert party.pixels > 40, party
                assert party.seen > 0.25, party
        assert page.errors == []


@pytest.mark.parametrize("width_px", [360, 1000])
def test_a_small_screen_shows_the_scene_and_scrolls_only_down(tmp_path, width_px):
    with Page(tmp_path / "profile", width_px=width_px, height_px=640) as page:
        for party in seen_parties(page, address(VERIFIED[0]), VERIFIED[0], in_3d=False):
            assert party.inside, party
            assert not party.covered, party
        assert page.run("document.documentElement.scrollWidth") <= width_px
        clipped = (
            "[...document.querySelectorAll('button, select, #graph, .party')].filter((each) => each.checkVisibility())"
        )
        assert page.run(f"{clipped}.every((each) => each.getBoundingClientRect().right <= innerWidth)")
