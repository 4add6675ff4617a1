"""The script of a replay's 3D view: within a page that stands alone, or once beside all pages of a site.

It is built from ``web/replay3d`` with three.js, whose licence stands at its beginning.
"""

from __future__ import annotations

from functools import cache
from html import escape
from typing import Final

from trace_dag.scenario.page_templates import packed, read

LIBRARY: Final = "replay3d.js"
"""The script's file, among the templates and on a site."""


@cache
def library_within() -> str:
    """The script of the 3D view, as an element of a page that stands alone."""
    return f'<script id="library" type="text/plain">{packed(read(LIBRARY).encode())}</script>'


def with_shared_library(page: bytes, address: str) -> bytes:
    """A replay whose 3D view's script lies beside it, at an address relative to the page, for sites of many replays."""
    return page.replace(library_within().encode(), f'<script src="{escape(address)}"></script>'.encode())
