"""Guesses from which the author of a mapping starts, made from the names and values of a table's columns."""

from __future__ import annotations

import datetime
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from trace_dag.common.data_files import read_toml
from trace_dag.common.errors import UserError
from trace_dag.crash.registers.rows import first_rows

_LOOKED_AT: Final = 2_000
_MOST_VALUES: Final = 60
_GUESSES: Final = read_toml("trace_dag.crash", "mapping_guesses.toml")
_NAMES: Final[Mapping[str, str]] = _GUESSES["columns"]
_VALUES: Final[Mapping[str, Mapping[str, int | str]]] = _GUESSES["values"]
_OF_CRASH: Final = ("MAN_COLL", "RELJCT2", "LGT_COND", "WEATHER")
_DATES: Final = ("%Y-%m-%d", "%m/%d/%Y", "%d/%m/%Y", "%Y/%m/%d", "%m/%d/%y", "%d.%m.%Y", "%Y%m%d")
_CLOCKS: Final = ("%H:%M", "%H:%M:%S", "%I:%M %p", "%I:%M:%S %p", "%H%M")


def guess_mapping(path: Path) -> str:
    """Return the text of a mapping for a table, with guesses marked.

    Raises :class:`UserError` for a table that cannot be read, or that has no column for an id or a time.
    """
    header, rows = first_rows(path, _LOOKED_AT)
    values = {name: [row[place].strip() for row in rows if place < len(row)] for place, name in enumerate(header)}
    found: dict[str, str] = {}
    for field, pattern in _NAMES.items():
        free = (
            name for name in header if name not in found.values() and re.search(pattern, name.strip(), re.IGNORECASE)
        )
        if (name := next(free, None)) is not None:
            found[field] = name
    time = _time(values)
    if "id" not in found or time is None:
        lacking = "that could be the id of a crash" if "id" not in found else "of dates in a known format"
        raise UserError(f"{path}: no column {lacking} among {', '.join(header)}; write the mapping by hand")
    return "\n".join(_lines(path, found, time, values)) + "\n"


def _lines(
    path: Path, found: Mapping[str, str], time: Sequence[tuple[str, str]], values: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    of_unit = max(Counter(values[found["id"]]).values(), default=1) > 1
    name = re.sub(r"[^a-z0-9_]+", "_", path.name.split(".")[0].lower()).strip("_") or "mine"
    yield f'register = "{name if name[0].isalpha() and name != "fars" else f"r_{name}"}"'
    yield 'name = "?"\nsource = "https://?"\nlicence = "?"\nattribution = "?"   # to be filled in'
    yield "point_accuracy_m = 15   # guess: how far points usually are from the crash"
    if of_unit:
        yield 'rows = "unit"   # guess: ids are repeated, so a row is a vehicle or a person'
    else:
        yield 'rows = "crash"   # guess: no id is repeated, so a row is a crash'
        yield 'units = ["1", "2"]   # guess: write {unit} where 1 and 2 stand in the names of columns of [unit]'
    yield "\n[crash]"
    yield f"id = {_quoted(found['id'])}   # guess"
    columns, formats = ([_quoted(each) for each in pair] for pair in zip(*time, strict=True))
    yield f"time = {{ column = [{', '.join(columns)}], format = [{', '.join(formats)}] }}   # guess"
    for field in ("latitude_deg", "longitude_deg", "trafficway_1", "trafficway_2"):
        yield f"{field} = {_quoted(found[field])}   # guess" if field in found else f'# {field} = "?"'
    for field in _OF_CRASH:
        if field in found:
            yield from _coded(f"crash.{field}", field, found[field], values)
    yield "\n[unit]"
    if "MOD_YEAR" in found:
        yield f"MOD_YEAR = {_quoted(found['MOD_YEAR'])}   # guess"
    if "VSPD_LIM" in found:
        yield f'VSPD_LIM = {{ column = {_quoted(found["VSPD_LIM"])}, unit = "mph" }}   # guess'
    for field in _VALUES:
        if field in found and field not in _OF_CRASH:
            yield from _coded(f"unit.{field}", field, found[field], values)


def _coded(table: str, field: str, column: str, values: Mapping[str, Sequence[str]]) -> Iterator[str]:
    yield f"\n[{table}]\ncolumn = {_quoted(column)}   # guess"
    if field == "heading":
        yield 'turning = "unknown"   # of one that turned: before, after or unknown'
    for value in [value for value, _ in Counter(filter(None, values[column])).most_common(_MOST_VALUES)]:
        fits = (code for pattern, code in _VALUES[field].items() if re.search(pattern, value, re.IGNORECASE))
        code = next(fits, None)
        if code is None:
            yield f"# values.{_quoted(value)} = ?"
        else:
            yield f"values.{_quoted(value)} = {_quoted(code) if isinstance(code, str) else code}   # guess"


def _time(values: Mapping[str, Sequence[str]]) -> list[tuple[str, str]] | None:
    """Return the columns of date and time, each with the format that fits all its values."""
    both = [f"{date}{gap}{clock}" for date in _DATES for gap in (" ", "T") for clock in _CLOCKS]
    for name, texts in values.items():
        if (form := _fitting(texts, both)) is not None:
            return [(name, form)]
    dates = [(name, form) for name, texts in values.items() if (form := _fitting(texts, _DATES)) is not None]
    clocks = [
        (name, form)
        for name, texts in values.items()
        if re.search("time|hour|hrmn", name, re.IGNORECASE) and (form := _fitting(texts, _CLOCKS)) is not None
    ]
    return [*dates[:1], *clocks[:1]] if dates else None


def _fitting(texts: Sequence[str], formats: Sequence[str]) -> str | None:
    known = [text for text in texts if text]
    return next((form for form in formats if known and all(_is_read(text, form) for text in known)), None)


def _is_read(text: str, form: str) -> bool:
    try:
        datetime.datetime.strptime(text, form)
    except ValueError:
        return False
    return True


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
