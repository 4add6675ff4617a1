"""Light and weather of a crash as the report has them."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.codes.crash import LGT_COND, WEATHER
from trace_dag.crash.record import CrashRecord

_DARK: Final = frozenset({2, 3, 6})  # LGT_COND: not lit, lit, dark without more


def is_dark(record: CrashRecord) -> bool:
    """Return whether it was dark, lit or not (``LGT_COND``).

    >>> is_dark(record), is_dark(pedestrian_record)  # LGT_COND 3, dark and lighted; 1, daylight
    (True, False)
    """
    return record.light_code in _DARK


def conditions_in_words(record: CrashRecord) -> str:
    """Return the reported light and weather, such as "in daylight, rain"; empty if neither is reported.

    >>> conditions_in_words(record)
    'in the dark on a lit road, clear weather'
    """
    said = []
    for table, code in ((LGT_COND, record.light_code), (WEATHER, record.weather_code)):
        if code is not None and code not in table.unknown and table.meaning(code):
            said.append(table.meaning(code))
    return ", ".join(said)
