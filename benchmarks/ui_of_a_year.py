"""Pages of the Dagster UI with as many partitions as a year has crashes: seconds until nothing on them changes.

``python -m benchmarks.ui_of_a_year FOLDER`` shows the root in FOLDER, as ``python -m benchmarks.warehouse ROOT FOLDER
--dagster`` has left it, in headless Chromium. Times are wall time of the page's own clock.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen

from benchmarks.kills import command
from tests.browser import Page

_PORT = 3991
_PAGES = {
    "assets, the first page opened": "/assets",
    "assets": "/assets",
    "lineage": "/asset-groups",
    "verdict": "/assets/verdict",
    "its partitions": "/assets/verdict?view=partitions",
    "its checks": "/assets/verdict?view=checks",
    "runs": "/runs",
    "overview": "/overview",
}
_STILL_S, _MOST_S = 2.5, 60.0
# What is shown, apart from clocks: a page with assets counts the seconds until it asks again.
_WATCH = """
(() => {
  window.still = {text: '', since: 0};
  setInterval(() => {
    const text = document.body.innerText.replace(/\\d+:\\d\\d|\\d+ \\w+ ago|Loading\\S*/g, '');
    if (text !== window.still.text) window.still = {text, since: performance.now()};
  }, 50);
})()
"""


def main() -> None:
    """Print the seconds of each page."""
    with (
        _served(Path(sys.argv[1])) as address,
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
        Page(Path(profile)) as page,
    ):
        for name, path in _PAGES.items():
            print(f"{name:32} {_seconds(page, address + path):6.2f} s", flush=True)


def _seconds(page: Page, address: str) -> float:
    page.send("Page.navigate", url=address)  # its scripts change the address, so that its arrival cannot be waited for
    page.run(_WATCH)
    began = time.monotonic()
    while time.monotonic() - began < _MOST_S:
        time.sleep(0.2)
        since_ms, now_ms, length = page.run("[window.still.since, performance.now(), window.still.text.length]")
        if length > 100 and now_ms - since_ms > 1e3 * _STILL_S:
            return float(since_ms) / 1e3
    raise RuntimeError(f"{address}: it still changes after {_MOST_S:.0f} s")


@contextmanager
def _served(root: Path) -> Iterator[str]:
    with Popen(
        command(root, "ui", "--read-only", "--port", str(_PORT)), stdout=PIPE, stderr=DEVNULL, text=True
    ) as server:
        try:
            if not any(line.startswith("Dagster UI on") for line in server.stdout or ()):
                raise RuntimeError("the UI did not start")
            yield f"http://127.0.0.1:{_PORT}"
        finally:
            server.terminate()


if __name__ == "__main__":
    main()
