"""Damage to bytes: drawn by Hypothesis, which shrinks it to the least that shows a fault, or at random."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

# fmt: off
_VALUES = (
    b"", b"0", b"-1", b"999999999999", b"1e309", b"-1e308", b"nan", b"inf", b"1e-320", b"0x10", b"\xd9\xa1", b"\x00",
    b"\xff\xfe", b"&amp;", b"&#0;", b"&undefined;", b"<", b"]]>", b"<!-- -->", b"{", b"[", b"null", b"true", b'"',
    b"../../x", b"%s", b"9" * 400, b"9" * 5000, b"\xf0\x9f\x98\x80", b"[" * 2000, b"<a>" * 300, b"\n", b",", b"=",
    b"'; DROP TABLE x; --",
)
# fmt: on
_INTERESTING = (b"0", b"1", b"2", b'"', b">", b"<", b",", b"=", b"\n", b":", b" ")


@st.composite
def damaged(draw: DrawFn, seeds: Sequence[bytes]) -> bytes:
    """One of some inputs with one to four changes: bytes and numbers replaced, parts left out, repeated or swapped."""
    data = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(1, 4))):
        data = _changed(data, *draw(_CHANGE))
    return data


def damaged_at_random(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    """As :func:`damaged`, twenty times as fast. Half keep their form, to come past what reads it: see ``_GENTLE``."""
    data, kinds = rng.choice(seeds), rng.choice((_KINDS, _GENTLE))
    for _ in range(rng.randint(1, 4)):
        data = _changed(data, rng.choice(kinds), rng.random(), rng.random(), rng.choice(_VALUES))
    return data


def _changed(data: bytes, kind: str, share: float, other: float, value: bytes) -> bytes:
    at = min(int(share * len(data)), len(data))
    end = min(at + 1 + int(other**4 * (len(data) - at)), len(data))
    if kind == "value":  # what stands between two marks: a number, a name, an attribute
        begin = max(data.rfind(mark, 0, at) for mark in _INTERESTING) + 1
        found = [place for mark in _INTERESTING if (place := data.find(mark, at)) >= 0]
        return data[:begin] + value + data[min(found, default=len(data)) :]
    if kind == "number":  # the next one becomes another
        number = _NUMBER.search(data, at)
        return data[: number.start()] + _NUMBERS[int(other * len(_NUMBERS))] + data[number.end() :] if number else data
    if kind == "insert":
        return data[:at] + value + data[at:]
    if kind == "flip":
        return data[:at] + bytes([int(other * 255.99)]) + data[at + 1 :]
    if kind == "delete":
        return data[:at] + data[end:]
    if kind == "repeat":
        return data[:end] + data[at:]
    if kind == "swap":
        return data[end:] + data[at:end] + data[:at]
    return data[:at]  # cut off


_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_NUMBERS = (b"0", b"1", b"-1", b"2", b"9", b"99", b"0.5", b"-7.25", b"1e-320", b"1e308", b"-1e9", b"9" * 19, b"4" * 400)
_GENTLE = ("number", "number", "number", "flip")
_KINDS = ("value", "value", "value", "insert", "flip", "flip", "delete", "repeat", "swap", "cut")
_SHARES = st.floats(0, 1, exclude_max=True)
_CHANGE: SearchStrategy[tuple[str, float, float, bytes]] = st.tuples(
    st.sampled_from(_KINDS), _SHARES, _SHARES, st.sampled_from(_VALUES)
)
