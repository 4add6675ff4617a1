"""The long columns of what a replay shows, in few characters: where a body is changes evenly for most of the time.

A column of numbers with few decimals becomes whole numbers, and of these the second differences: zeros and ones where a
body goes on as before. Compressed it is a quarter of the numbers' text. ``column()`` of the page
(``templates/replay_columns.js``) makes the same numbers of it again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

_LEAST: Final = 16  # numbers or rows: shorter lists stay as they are
_PARTS: Final = (1, 10, 100, 1000, 10_000)  # of a unit


def with_columns(value: Any) -> Any:
    """A JSON value in which long lists of decimal numbers, or of rows of them, are kept as second differences.

    >>> with_columns({"x": [0.5 * k for k in range(20)]})["x"]["by"][:4]  # half a metre each time
    [0, 5, 0, 0]
    """
    if isinstance(value, Mapping):
        return {name: with_columns(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return _column(value) or [with_columns(each) for each in value]
    return value


def _column(values: list[Any] | tuple[Any, ...]) -> dict[str, Any] | None:
    """A list as ``by``, column after column, in ``per`` parts of a unit, and the ``width`` of its rows; None for any
    that these would not be the same as."""
    first = values[0] if len(values) >= _LEAST else None
    if not isinstance(first[0] if isinstance(first, list) and first else first, float):
        return None
    try:
        numbers = np.array(values, float)
    except (TypeError, ValueError):  # it has gaps, or rows of several lengths
        return None
    for per in _PARTS:
        whole = np.rint(numbers * per)
        if (whole / per == numbers).all():
            before = np.zeros_like(whole[:2])
            by = np.diff(whole, n=2, axis=0, prepend=before).astype(np.int64).T.reshape(-1).tolist()
            return {"by": by, "per": per} | ({"width": numbers.shape[1]} if numbers.ndim == 2 else {})
    return None
