"""The key of a crash, ``<caseYear>-<stateCase>``: made and read in one place.

A ``stateCase`` is unique only within its year. A key is put together from two checked integers, so that nothing a
report says can become a path.
"""

from __future__ import annotations

import re
from typing import Final

from trace_dag.errors import UserError

_KEY: Final = re.compile(r"(?P<year>[12][0-9]{3})-(?P<case>[1-9][0-9]{4,5})")
_SHOWN: Final = 40  # characters of what is none


def crash_key(case_year: int, state_case: int) -> str:
    """The key of a crash. Raises ValueError for numbers that FARS does not use.

    >>> crash_key(2023, 510179)
    '2023-510179'
    """
    key = f"{case_year:d}-{state_case:d}"
    if not _KEY.fullmatch(key):
        raise ValueError(
            f"case year {case_year} and state case {state_case} make no key; expected a four-digit year and a "
            "five or six digit case number (state * 10000 + number)"
        )
    return key


def parse_key(key: str) -> tuple[int, int]:
    """Case year and state case of a key. Raises UserError for anything that is not one.

    >>> parse_key('2023-510179')
    (2023, 510179)
    """
    match = _KEY.fullmatch(key)
    if match is None:
        shown = f"{key[:_SHOWN]!r}{'...' if len(key) > _SHOWN else ''}"
        raise UserError(f"{shown} is not a crash key; expected <caseYear>-<stateCase>, such as 2023-510179")
    return int(match["year"]), int(match["case"])


def state_of(state_case: int) -> int:
    """The ``STATE`` code a state case belongs to.

    >>> state_of(510179)  # Virginia
    51
    """
    return state_case // 10_000
