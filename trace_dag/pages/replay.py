"""A replay of a simulated crash: one HTML page with all its data, which opens anywhere.

The map is drawn once, as SVG, by the code of the pictures; the page moves the bodies of the log over it. No network, no
library, no CDN. A site has one such page for all of its crashes, and a data file for each. The animated pictures of the
same thing are in :mod:`trace_dag.pages.animation`.

The script of the 3D view is in each self-contained page, or once beside all pages of a site. It is built from
``web/replay3d`` with three.js, whose licence is at its beginning.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trace_dag.crash.record import CrashRecord
from trace_dag.pages.drive import AgentDrive
from trace_dag.pages.map_scene import Window
from trace_dag.pages.page_templates import compress, encode_base64, read, render
from trace_dag.pages.replay_content import (
    ReplayContent,
    ReplayWindows,
    choose_windows,
    place_in_words,
    replay_content,
    square,
)
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import SimulationLog

if TYPE_CHECKING:
    from collections.abc import Mapping

    from trace_dag.osm.types import OsmFeature

PAGE: Final = "replay.html"
"""The page of a site that shows every replay of it: ``replay.html?KEY``."""

LIBRARY: Final = "replay3d.js"
"""The script's file, among the templates and on a site."""


def replay_page(content: ReplayContent, *, in_3d: bool = True, paired: bool = False) -> bytes:
    """Return a self-contained page, in plan view only without ``in_3d`` or content in 3D.

    A ``paired`` page has no time line, because the surrounding page has one (:func:`write_html_pair`).

    Equal content gives equal bytes.

    >>> from trace_dag.pages.replay_content import replay_content
    >>> replay_page(replay_content(record, network, log, in_3d=False))[:15]
    b'<!DOCTYPE html>'
    """
    solid = content.solid if in_3d else None
    return render(
        "replay.html.jinja",
        title=content.said["title"],
        paired=paired,
        in_3d=solid is not None,
        data=_script_safe(content.said),
        map_svg=encode_base64(content.zipped_map),
        solid=encode_base64(compress(solid)) if solid is not None else "",
        library=pack_library() if solid is not None else "",
    )


def replay_script(content: ReplayContent) -> bytes:
    """Return the script with one crash for the replay page of a site.

    It calls the page with the parts of the content, as gzip in base64.

    >>> from trace_dag.pages.replay_content import replay_content
    >>> replay_script(replay_content(record, network, log, in_3d=False))[:8]
    b'replay({'
    """
    said = json.dumps(content.said, separators=(",", ":"), allow_nan=False)
    parts = {"data": compress(said.encode()), "map": content.zipped_map}
    if content.solid is not None:
        parts["solid"] = compress(content.solid)
    held = ",".join(f'"{name}":"{encode_base64(data)}"' for name, data in parts.items())
    return f"replay({{{held}}})\n".encode()


def _around(windows: Sequence[Window]) -> Window:
    """Return the smallest square around some windows."""
    low, high = np.array(windows)[:, :2].min(axis=0), np.array(windows)[:, 2:].max(axis=0)
    return square((low + high) / 2, float((high - low).max()) / 2)


def write_html_pair(
    record: CrashRecord,
    network: RoadNetwork,
    driven: Sequence[tuple[AgentDrive, SimulationLog]],
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> bytes:
    """Return the drives of several agents in one crash, side by side on one page with one time line."""
    each = [choose_windows(log, drive) for drive, log in driven]
    windows = ReplayWindows(_around([one.overview for one in each]), each[0].impact)
    content = partial(replay_content, record, network, surroundings=surroundings, beside=windows, in_3d=False)
    recorded = driven[0][0].recorded
    contact = recorded.first_contact
    return render(
        "replay_pair.html.jinja",
        title=f"Crash {record.key}: {' and '.join(drive.agent for drive, _ in driven)}",
        place=place_in_words(record),
        sides=[(drive.title, replay_page(content(log, drive=drive), paired=True).decode()) for drive, log in driven],
        hit="null" if contact is None else round(contact.time_s, 4),
        end=round(max(float(log.vehicles[0].time_s[-1]) for _, log in driven), 3),
    )


def _script_safe(data: Mapping[str, Any]) -> str:
    """Return JSON that is safe within a script element for any text of a report."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


# --- files common to all replays -------------------------------------------------------------------------------------
@cache
def pack_library() -> str:
    """Return the compressed script for a self-contained page."""
    return encode_base64(compress(read(LIBRARY).encode()))


def site_files() -> dict[str, bytes]:
    """Return the files of a site for its replays without the 3D library: the page and its script.

    >>> sorted(site_files())
    ['replay.html', 'replay.js']
    """
    shown = {"title": "Replay", "paired": False, "in_3d": True}
    pages = {PAGE: "site_replay.html.jinja", "replay.js": "replay_main.js.jinja"}
    return {name: render(template, **shown) for name, template in pages.items()}
