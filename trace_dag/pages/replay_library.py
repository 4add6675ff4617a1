"""Files common to all replays: the script of the 3D view, and the one page of a site for every crash.

The script is in each self-contained page, or once beside all pages of a site. It is built from ``web/replay3d`` with
three.js, whose licence is at its beginning.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from trace_dag.pages.page_templates import compress, encode_base64, read, templates

PAGE: Final = "replay.html"
"""The page of a site that shows every replay of it: ``replay.html?KEY``."""

LIBRARY: Final = "replay3d.js"
"""The script's file, among the templates and on a site."""


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
    return {name: templates().get_template(template).render(shown).encode() for name, template in pages.items()}
