"""Limits on what is read from packages and releases, which may come from anybody, checked before it is parsed."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from trace_dag.common.errors import DamagedFile

MOST_BYTES: Final = 64_000_000
"""Limit for one file: a crash's largest has some two million."""
_DEEPEST: Final = 32
"""Lists and objects within each other: ours go to ten."""
_MOST_ELEMENTS: Final = 2_000_000
"""Most elements of a JSON file: a crash's largest has some 200,000, and each takes up to a hundred bytes of memory."""
GET_AGAIN: Final = "get it again from where it came from"
_TEXT: Final = re.compile(rb'"(?:[^"\\]|\\.)*+"')
_NO_NUMBER: Final = re.compile(rb"NaN|Infinity|[0-9][eE]\+?[0-9]{3}")


def check_size(name: str, size: int) -> None:
    """Raise :class:`DamagedFile` for a file above the size limit.

    >>> check_size("manifest.json", 1_200_000_000)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    trace_dag.common.errors.DamagedFile: manifest.json: damaged: has 1,200 MB, at most 64 are read; ...
    """
    if size > MOST_BYTES:
        raise DamagedFile(name, f"has {size / 1e6:,.0f} MB, at most {MOST_BYTES / 1e6:.0f} are read", GET_AGAIN)


def check_json(name: str, data: bytes) -> None:
    """Raise :class:`DamagedFile` for JSON with too many elements, too deep nesting, or NaN or infinite numbers.

    >>> check_json("manifest.json", b'{"key": "[[[[", "files": {}}')
    """
    bare = _TEXT.sub(b"", data)
    elements = sum(map(bare.count, (b",", b"[", b"{")))
    if elements > _MOST_ELEMENTS:
        raise DamagedFile(name, f"JSON with {elements:,} elements, at most {_MOST_ELEMENTS:,} are read", GET_AGAIN)
    brackets = np.frombuffer(re.sub(rb"[^\[\]{}]+", b"", bare), np.uint8)
    depth = int(np.where(np.isin(brackets, list(b"[{")), 1, -1).cumsum().max(initial=0))
    if depth > _DEEPEST:
        raise DamagedFile(name, f"JSON that is nested {depth:,} deep, at most {_DEEPEST} are read", GET_AGAIN)
    if found := _NO_NUMBER.search(bare):
        raise DamagedFile(name, f"{found[0].decode()} in place of a number", GET_AGAIN)
