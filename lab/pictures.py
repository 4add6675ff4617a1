"""Pictures of README and the docs: a crash of the sample that moves, and pages of the Dagster UI.

    python -m lab --root trace_dag_home pictures

The root holds the sample (``trace-dag demo``). Needs Chromium; writes to ``docs/images``.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import click
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "tests"))

import trace_dag
from lab.commands import run_study
from tests.assets.test_web_server import serving
from tests.browser import Page
from trace_dag.cli.options import pass_root

_KEY = "2023-319018"  # in daylight, into a roundabout
_VIEW = "view=impact&pane=both&from=eyes-1"
_STYLE = ":is(header, #tools, #controls, #likely, #told, #note, #more) { display: none !important }"
_DRAWN_S = 4.0  # animations of the UI have ended
_FRAMES_PER_S, _LENGTH_S = 10, 8.0
_SIZE_PX = (880, 560)
_IMAGES = Path(__file__).resolve().parents[1] / "docs/images"
_UI_SIZE_PX = (1150, 760)
_UI = {
    "ui_partition": (f"/assets/verdict?view=partitions&partition={_KEY}", "sketch", ""),
    "ui_materialize": ("/assets/verdict?view=partitions", _KEY, "Materialize"),
    "ui_funnel": ("/assets/warehouse?view=events", "funnel", ""),
}
"""Pages of the UI by the name of their picture: address, a text that is there when it is drawn, a button to press."""


@click.command()
@pass_root
def pictures(root: str) -> None:
    """Film the replay of a crash as an animated WebP, and take pictures of the Dagster UI."""
    target = _IMAGES / "crash.webp"
    with tempfile.TemporaryDirectory() as folder:
        page_file = Path(folder) / "replay.html"
        trace_dag.open(root)[_KEY].replay().save(page_file)
        with Page(Path(folder), width_px=_SIZE_PX[0], height_px=_SIZE_PX[1]) as page:
            frames = list(_frames(page, page_file))
    frames[0].save(
        target,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 / _FRAMES_PER_S),
        loop=0,
        quality=55,
        method=6,
    )
    click.echo(f"{target}  {target.stat().st_size / 1024:.0f} kB")
    _ui_pictures(root)


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
        yield _shot(page)


def _shot(page: Page) -> Image.Image:
    shot = page.send("Page.captureScreenshot", format="png")["data"]
    return Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")


def _ui_pictures(root: str) -> None:
    with tempfile.TemporaryDirectory() as profile, serving(Path(root)) as server:
        for name, (address, text, button) in _UI.items():
            with Page(Path(profile) / name, width_px=_UI_SIZE_PX[0], height_px=_UI_SIZE_PX[1]) as page:
                page.send("Page.navigate", url=f"http://{server.host}{address}")
                page.wait(f"document.body && document.body.innerText.includes({text!r})")
                if button:
                    press = f"[...document.querySelectorAll('button')].find(b => b.innerText.startsWith({button!r}))"
                    page.wait(f"!!{press}")
                    page.run(f"{press}.click()")
                time.sleep(_DRAWN_S)
                _shot(page).quantize(128).save(_IMAGES / f"{name}.png", optimize=True)
                click.echo(_IMAGES / f"{name}.png")


if __name__ == "__main__":
    run_study(pictures)
