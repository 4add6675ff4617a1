"""Measures what the replays of a root's pages show, in a real browser.

    python -m benchmarks.replay_frames ROOT [KEY ...]

For each replay's first frame, contact and end, in the plan and in three dimensions: whether every party is in the
picture, whole, which share of it is seen, and whether anything of the page covers it. Then how long the first view
takes on a processor four times slower, and how large page and content are. Needs Chromium.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.browser import Page
from tests.scenario.replay_frames import first_view_s, seen_parties

LEAST_SEEN = 0.25
SHARED = ("replay.html", "replay.js", "replay3d.js")


def main(root: str, *keys: str) -> None:
    """Prints what falls short, party by party, and the figures of all."""
    pages = Path(root).resolve() / "benchmark"
    keys = keys or tuple(sorted(path.stem for path in (pages / "replays").glob("*.js")))
    parties, seconds, bytes_each = [], [], []
    shared = sum((pages / name).stat().st_size for name in SHARED)
    for key in keys:
        address = f"{(pages / 'replay.html').as_uri()}?{key}"
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Page(Path(profile)) as page:
            seconds.append(first_view_s(page, address))
            parties += seen_parties(page, address, key)
            if page.errors:
                print(key, page.errors[0])
        bytes_each.append(shared + (pages / "replays" / f"{key}.js").stat().st_size)
    short = [each for each in parties if not each.inside or each.covered or each.seen < LEAST_SEEN]
    for each in short:
        print(each)
    for moment in ("first", "contact", "end"):
        of_it = [each for each in parties if each.moment == moment]
        good = sum(each not in short for each in of_it)
        print(f"{moment}: {good} of {len(of_it)} parties inside, not covered, at least {LEAST_SEEN:.0%} seen")
        pixels = [each.pixels for each in of_it if each.view == "3D"]
        print(f"  in three dimensions {np.median(pixels):.0f} pixels each in the median, least {min(pixels)}")
    print(f"first view, processor four times slower: median {np.median(seconds):.2f} s, most {max(seconds):.2f} s")
    print(f"page with its content: median {np.median(bytes_each) / 1e6:.2f} MB, most {max(bytes_each) / 1e6:.2f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
