"""The key of a crash: made and read in one place, so that no text of a report can become a path.

FARS' keys are ``<caseYear>-<stateCase>``: a ``stateCase`` is unique only within its year. Those of other registers are
``<register>-<id>``. A register's name begins with a letter, so that the two cannot be confused. Characters of an id
other than letters, digits, ``-`` and ``_`` are encoded, so that a key is safe as the name of a file, as a partition and
in a URL.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from trace_dag.common.errors import UserError

FARS: Final = "fars"
"""The name of NHTSA's register of fatal crashes."""
REGISTER_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,31}")
_FARS_KEY: Final = re.compile(r"(?P<year>[12][0-9]{3})-(?P<case>[1-9][0-9]{4,5})")
_KEY: Final = re.compile(rf"(?P<register>{REGISTER_NAME.pattern})-(?P<id>[A-Za-z0-9_][A-Za-z0-9_-]{{0,149}})")
_TO_ENCODE: Final = re.compile(r"[^A-Za-z0-9_-]|^-|_(?=[0-9A-F]{2})")  # the last: so that no two ids are one key
_SHOWN: Final = 40  # characters of what is none


@dataclass(frozen=True, slots=True)
class CrashKey:
    """A key taken apart: the register, and the number of the crash there (FARS: ``stateCase``, of ``case_year``)."""

    register: str
    id: str
    case_year: int | None = None

    @property
    def state_case(self) -> int | None:
        """Return FARS' ``stateCase``; None for other registers."""
        return None if self.case_year is None else int(self.id)

    @property
    def order(self) -> tuple[object, ...]:
        """Return the sorting key: FARS by year and number, then other registers by name, numeric ids by size."""
        number = int(self.id) if self.id.isascii() and self.id.isdigit() else -1
        return (self.register != FARS, self.register, self.case_year or 0, number, self.id)


def crash_key(case_year: int, state_case: int) -> str:
    """Return the key of a crash in FARS.

    Raises ValueError for numbers that FARS does not use.

    >>> crash_key(2023, 510179)
    '2023-510179'
    """
    key = f"{case_year:d}-{state_case:d}"
    if not _FARS_KEY.fullmatch(key):
        raise ValueError(
            f"case year {case_year} and state case {state_case} make no key; expected a four-digit year and a "
            "five or six digit case number (state * 10000 + number)"
        )
    return key


def register_key(register: str, crash_id: str) -> str:
    """Return the key of a crash in another register.

    Characters that a key must not have become ``_`` and the two digits of each of their bytes, like ``%`` in a URL.

    Raises ValueError for a blank or too long id.

    >>> register_key("tempe", "2579417"), register_key("utah", "2022/45 A")
    ('tempe-2579417', 'utah-2022_2F45_20A')
    """
    encoded = _TO_ENCODE.sub(lambda match: "".join(f"_{byte:02X}" for byte in match[0].encode()), crash_id)
    key = f"{register}-{encoded}"
    if register == FARS or not _KEY.fullmatch(key):
        raise ValueError(
            f"register {register!r} and id {crash_id[:_SHOWN]!r} make no key; expected lower-case letters, digits and "
            "_ in the one, 1 to 150 letters, digits, - and _ in the other"
        )
    return key


def parse_key(key: str) -> CrashKey:
    """Return a key's parts.

    Raises UserError for text that is no key.

    >>> parse_key("2023-510179").state_case, parse_key("tempe-2579417").register
    (510179, 'tempe')
    """
    of_fars = _FARS_KEY.fullmatch(key)
    if of_fars is not None:
        return CrashKey(FARS, of_fars["case"], int(of_fars["year"]))
    match = _KEY.fullmatch(key)
    if match is None or match["register"] == FARS:
        shown = f"{key[:_SHOWN]!r}{'...' if len(key) > _SHOWN else ''}"
        raise UserError(
            f"{shown} is not a crash key; expected <caseYear>-<stateCase>, such as 2023-510179, or <register>-<id>, "
            "such as tempe-2579417"
        )
    return CrashKey(match["register"], match["id"])


def fars_case(key: str) -> tuple[int, int]:
    """Return the case year and state case of a FARS key.

    Raises UserError for a key of another register.

    >>> fars_case("2023-510179")
    (2023, 510179)
    """
    parsed = parse_key(key)
    if parsed.case_year is None or parsed.state_case is None:
        raise UserError(f"{key} is a crash of register {parsed.register}; expected one of FARS, such as 2023-510179")
    return parsed.case_year, parsed.state_case


def state_of(state_case: int) -> int:
    """Return the ``STATE`` code a state case belongs to.

    >>> state_of(510179)  # Virginia
    51
    """
    return state_case // 10_000
