"""A pass over a large map that is killed goes on where it was, and ends with the same pieces."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import osmium
from sample_runs import SAMPLE

# Each child is killed at its seventh step: a segment read, or a piece about to be stored (five are noted at a time).
KILLED_AGAIN_AND_AGAIN = """
import os, signal, sys
from pathlib import Path
from trace_dag.osm import dividing, extraction, first_look, segments
from trace_dag.osm.catalog import box_around
from trace_dag.osm.extraction import read_header
from trace_dag.osm.large_map import Around, LargeMap
from trace_dag.osm.types import Site
from trace_dag.storage import Storage

file, folder, interrupted = Path(sys.argv[1]), sys.argv[2], sys.argv[3] == "interrupted"
extraction._LARGE, segments.SEGMENT_BYTES, dividing._TOGETHER = 0, 4000, 5
first_look.NOTE_EVERY_S = 0.0
sites = [Site(f"2023-{number}", 41.83 + number * 2e-4, -101.545 + number * 8e-4) for number in range(20)]
around = [Around(site.key, box_around(site, 300.0), box_around(site, 150.0)) for site in sites]

def divide():
    large = LargeMap(file, read_header(file), "0" * 64, Storage(folder))
    steps = 0

    def step(*_):
        nonlocal steps
        steps += 1
        if interrupted and steps == 7:
            os.kill(os.getpid(), signal.SIGKILL)

    store = LargeMap.keep_piece

    def keep_piece(self, *arguments, **named):
        step()
        store(self, *arguments, **named)

    LargeMap.keep_piece = keep_piece
    assert dividing.divide(large, around, service_roads=True, tell=step)

killed = 0
while True:
    child = os.fork()
    if not child:
        divide()
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if status == 0:
        break
    assert os.WTERMSIG(status) == signal.SIGKILL, status
    killed += 1
print(killed, sorted(os.listdir(Path(folder) / "cache" / "map-work")))
"""


def in_small_blobs(source: Path, target: Path) -> Path:
    """A map of the sample as a sorted ``.osm.pbf`` of many blobs."""
    header = osmium.io.Header()
    header.set("sorting", "Type_then_ID")
    header.add_box(osmium.osm.Box(-101.57, 41.82, -101.51, 41.85))
    with osmium.SimpleWriter(str(target), header=header, bufsz=10_000) as writer:
        osmium.apply(str(source), writer)
    return target


def pieces_after(folder: Path, file: Path, how: str) -> tuple[list[str], dict[str, bytes]]:
    done = subprocess.run(
        [sys.executable, "-c", KILLED_AGAIN_AND_AGAIN, file, folder, how], capture_output=True, text=True, check=True
    )
    kept = {path.name: path.read_bytes() for path in (folder / "cache" / "maps").iterdir()}
    return done.stdout.split(maxsplit=1), kept


def test_a_pass_that_is_killed_at_every_step_ends_with_the_same_pieces(tmp_path: Path) -> None:
    file = in_small_blobs(SAMPLE / "osm" / "merrow.osm", tmp_path / "merrow.osm.pbf")
    (killed, _), undisturbed = pieces_after(tmp_path / "undisturbed", file, "undisturbed")
    assert killed == "0"
    (killed, left), interrupted = pieces_after(tmp_path / "interrupted", file, "interrupted")
    assert int(killed) > 3
    assert "first-look'" not in left
    assert "pieces'" not in left  # but for the locks
    assert len(interrupted) == 21
    assert interrupted == undisturbed
