"""Moving picture of README: a crash of the sample in its replay, the plan beside the view of a driver.

    python -m lab --root trace_dag_home pictures

The root holds the sample (``trace-dag demo``). Needs Chromium; writes ``docs/images/crash.webp``.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import click
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import trace_dag
from lab.commands import run_study
from tests.browser import Page
from trace_dag.cli.options import pass_root

_KEY = "2023-319018"  # in daylight, into a roundabout
_VIEW = "view=impact&pane=both&from=eyes-1"
_STYLE = ":is(header, #tools, #controls, #likely, #told, #note, #more) { display: none !important }"
_FRAMES_PER_S, _LENGTH_S = 10, 8.0
_SIZE_PX = (880, 560)
_TARGET = Path(__file__).resolve().parents[1] / "docs/images/crash.webp"


@click.command()
@pass_root
def pictures(root: str) -> None:
    """Film the replay of a crash as an animated WebP."""
    with tempfile.TemporaryDirectory() as folder:
        page_file = Path(folder) / "replay.html"
        trace_dag.open(root)[_KEY].replay().save(page_file)
        with Page(Path(folder), width_px=_SIZE_PX[0], height_px=_SIZE_PX[1]) as page:
            frames = list(_frames(page, page_file))
    frames[0].save(
        _TARGET,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 / _FRAMES_PER_S),
        loop=0,
        quality=55,
        method=6,
    )
    click.echo(f"{_TARGET}  {_TARGET.stat().st_size / 1024:.0f} kB")


def _frames(page: Page, replay: Path) -> Iterator[Image.Image]:
    """Yield both views and the parties with their speeds, over the whole crash."""
    page.open(f"{replay.as_uri()}#t=0&{_VIEW}")
    page.wait("document.body.dataset.solid === 'drawn'")
    page.run(f"document.head.append(Object.assign(document.createElement('style'), {{ textContent: '{_STYLE}' }}))")
    page.run("dispatchEvent(new Event('resize'))")
    number = round(_LENGTH_S * _FRAMES_PER_S)
    for k in range(number):
        page.run(f"line.show(end * {k / (number - 1)})")
        page.run("new Promise(shown => requestAnimationFrame(() => requestAnimationFrame(shown)))")
        shot = page.send("Page.captureScreenshot", format="png")["data"]
        yield Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")


if __name__ == "__main__":
    run_study(pictures)
