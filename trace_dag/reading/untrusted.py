"""Limits on what is read from packages and releases, which may come from anybody, checked before it is parsed."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from trace_dag.errors import DamagedFile

MOST_BYTES: Final = 64_000_000
"""Of one file: a crash's largest has some two million."""
_DEEPEST: Final = 32
"""Lists and objects within each other: ours go to ten."""
GET_AGAIN: Final = "get it again from where it came from"
_TEXT: Final = re.compile(rb'"(?:[^"\\]|\\.)*+"')
_NO_NUMBER: Final = re.compile(rb"NaN|Infinity|[0-9][eE]\+?[0-9]{3}")


def check_size(name: str, size: int) -> None:
    """Raise :class:`DamagedFile` for a file that is larger than any of ours.

    >>> check_size("manifest.json", 1_200_000_000)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    trace_dag.errors.DamagedFile: manifest.json: damaged: has 1,200 MB, at most 64 are read; ...
    """
    if size > MOST_BYTES:
        raise DamagedFile(name, f"has {size / 1e6:,.0f} MB, at most {MOST_BYTES / 1e6:.0f} are read", GET_AGAIN)


def check_json(name: str, data: bytes) -> None:
    """Raise :class:`DamagedFile` for JSON that is nested too deep, or has numbers that are none.

    >>> check_json("manifest.json", b'{"key": "[[[[", "files": {}}')
    """
    bare = _TEXT.sub(b"", data)
    letters = np.frombuffer(bare, np.uint8)
    opens, closes = (np.isin(letters, list(each)) for each in (b"[{", b"]}"))
    depth = int((opens.astype(np.int32) - closes).cumsum().max(initial=0))
    if depth > _DEEPEST:
        raise DamagedFile(name, f"JSON that is nested {depth:,} deep, at most {_DEEPEST} are read", GET_AGAIN)
    if found := _NO_NUMBER.search(bare):
        raise DamagedFile(name, f"{found[0].decode()} in place of a number", GET_AGAIN)
