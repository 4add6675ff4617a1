"""Artefacts that are text are stored compressed: maps and reports are a tenth of the size so.

The name says which: those that end with ``.gz``, which ``gunzip`` and most tools read as well. The same content gives
the same bytes.
"""

from __future__ import annotations

import gzip
from typing import Final

_ENDING: Final = ".gz"
_LEVEL: Final = 5  # a map in three quarters of the time of level 6, and a twentieth larger


def kept(name: str, content: bytes) -> bytes:
    """What a file of that name holds of its content.

    >>> kept('road_map/2023-1.json', b'{}')
    b'{}'
    """
    return gzip.compress(content, _LEVEL, mtime=0) if name.endswith(_ENDING) else content


def content_of(name: str, data: bytes) -> bytes:
    """The content of a file of that name.

    >>> content_of('2023-1.xodr.gz', kept('2023-1.xodr.gz', b'<OpenDRIVE/>'))
    b'<OpenDRIVE/>'
    """
    return gzip.decompress(data) if name.endswith(_ENDING) else data
