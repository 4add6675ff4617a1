"""The script of a replay's 3D view: within a page that stands alone, or once beside all pages of a site.

It is built from ``web/replay3d`` with three.js, whose licence stands at its beginning.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from trace_dag.scenario.page_templates import packed, read

LIBRARY: Final = "replay3d.js"
"""The script's file, among the templates and on a site."""


@cache
def packed_library() -> str:
    """The script, for a page that stands alone.

    >>> len(packed_library()) < len(read(LIBRARY))
    True
    """
    return packed(read(LIBRARY).encode())
