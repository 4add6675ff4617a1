"""FARS national CSV files as a source: crashes listed for cohorts, and the rows of each as its report."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.errors import Rejection, UserError
from trace_dag.crash.fars.files import TABLES, FarsRelease, find_releases
from trace_dag.crash.fars.rows import FarsRows
from trace_dag.crash.fields import Row
from trace_dag.crash.keys import crash_key, fars_case
from trace_dag.crash.listing import CrashListing, list_rows
from trace_dag.crash.parse import report_to_json

if TYPE_CHECKING:
    import pyarrow as pa

Rows: TypeAlias = dict[int, list[Row]]
"""Rows by ``ST_CASE``."""

_SEQUENCES: Final = ("cevent", "vevent", "vsoe")
_LISTED: Final = {
    "accident": (
        *("LATITUDE", "LONGITUD", "COUNTY", "CITY", "COUNTYNAME", "CITYNAME", "ROUTE", "FUNC_SYS", "ROAD_FNC"),
        *("VE_FORMS", "HARM_EV", "MAN_COLL", "TYP_INT", "RELJCT2"),
    ),
    "vehicle": ("VEH_NO", "ACC_TYPE"),
    "parkwork": ("VEH_NO",),
    "cevent": ("EVENTNUM", "SOE", "VNUMBER1", "VNUMBER2"),
    "vevent": ("VEH_NO", "EVENTNUM", "SOE"),
    "vsoe": ("VEH_NO", "SOE"),
}
"""Tables and columns that a listing takes."""
_WITHOUT: Final = {
    "accident": "where and when the crashes were",
    "vehicle": "bodies, speeds, movements and crash types",
    "cevent": "the order of events is put together from those of each vehicle",
    "vsoe": "areas of impact are those of cevent or the vehicle's first",
    "person": "people outside vehicles, ages and belts are those of other tables, or unknown",
    "pbtype": "directions and positions of pedestrians and cyclists are unknown",
    "damage": "damaged areas are unknown",
    "maneuver": "what drivers avoided is unknown",
}
"""Tables, and what is missing without them."""
_YEAR: Final = re.compile(r"[0-9]{1,9}")
_MISSING_IN_R: Final = "NA"
_BATCH: Final = 1000
"""Crashes whose rows are turned into Python objects at a time; bounds the memory of a national year."""


class FarsCsvSource:
    """The crashes of every release at one path. Tables are read when they are first needed, and then kept."""

    def __init__(self, releases: Iterable[FarsRelease]) -> None:
        self._releases = tuple(_ReleaseTables(release) for release in releases)

    @classmethod
    def open(cls, path: Path) -> FarsCsvSource:
        """Return the releases in a folder (searched to the bottom) or zip.

        Raises UserError if there is none.
        """
        return cls(find_releases(Path(path)))

    def notes(self) -> list[str]:
        """Return the tables present and missing in each year, and the effects of the missing ones.

        Raises UserError for a year in which no crash could be reconstructed.
        """
        return [release.note() for release in self._releases]

    def listings(self) -> list[CrashListing]:
        """Return one line per crash, in order of keys.

        A crash of several releases is listed from the first one.
        """
        found: dict[str, CrashListing] = {}
        for release in self._releases:
            for listing in release.listings():
                found.setdefault(listing.key, listing)
        return [found[key] for key in sorted(found)]

    def reports(self, keys: Iterable[str] | None = None) -> Iterator[tuple[str, bytes]]:
        """Yield key and rows, as JSON, of the given crashes (None: all), once each; others are skipped.

        Raises UserError for a malformed key.
        """
        wanted = None if keys is None else {fars_case(key) for key in keys}
        done: set[tuple[int, int]] = set()
        for release in self._releases:
            cases = [
                state_case
                for state_case in release.state_cases
                if (release.year, state_case) not in done and (wanted is None or (release.year, state_case) in wanted)
            ]
            done.update((release.year, state_case) for state_case in cases)
            yield from release.reports(cases)


class _SortedTable:
    """A table in order of ``ST_CASE``, so that the rows of some crashes are found without a search."""

    def __init__(self, table: pa.Table, label: str) -> None:
        import pyarrow as pa
        import pyarrow.compute as pc

        try:
            whole = pc.replace_substring_regex(pc.utf8_trim_whitespace(table["ST_CASE"]), r"\.0*$", "")  # pandas' 7.0
            cases = pc.cast(whole, pa.int64()).to_numpy()
        except pa.ArrowInvalid as error:
            raise UserError(f"{label}: a value of ST_CASE is not a number ({error})") from error
        self.cases: NDArray[np.int64] = cases
        self.table = table
        if (cases[1:] < cases[:-1]).any():  # NHTSA's are in order: no second copy of a national table
            order = np.argsort(cases, kind="stable")
            self.cases, self.table = cases[order], table.take(order)

    def rows(self, first: int, last: int, columns: Sequence[str] | None = None) -> Iterator[tuple[int, Row]]:
        """Yield ``ST_CASE`` and the non-blank values of each row from case ``first`` to ``last``."""
        low, high = np.searchsorted(self.cases, [first, last + 1])
        part = self.table.slice(low, high - low)
        there = part.column_names  # made anew, of all columns, each time it is asked for
        names = there if columns is None else [name for name in columns if name in there]
        values = [part[name].to_pylist() for name in names]
        for index, case in enumerate(self.cases[low:high].tolist()):
            row = {
                name: text
                for name, column in zip(names, values, strict=True)
                if (value := column[index]) and (text := value.strip()) and text != _MISSING_IN_R
            }
            yield case, row


class _ReleaseTables:
    """The tables of one release, of one case year."""

    def __init__(self, release: FarsRelease) -> None:
        self._release = release
        self._tables: dict[str, _SortedTable | None] = {}

    @cached_property
    def year(self) -> int:
        """Return the case year of ``accident.csv``, or of the path if the table lacks the column."""
        table = self._release.table("accident")
        column = next((name for name in ("YEAR", "CASEYEAR") if table is not None and name in table.column_names), None)
        if table is None or column is None:
            if self._release.year_in_path is None:
                what = "there is no accident.csv" if table is None else "accident.csv has no column YEAR"
                raise UserError(
                    f"{self._release.label}: {what}, and its path names no year; expected the year in the name of the "
                    "file or of a folder, such as fars-2016"
                )
            return self._release.year_in_path
        years = {year.strip().partition(".")[0] for year in table[column].to_pylist()}
        if len(years) != 1 or not _YEAR.fullmatch(year := next(iter(years))):
            raise UserError(
                f"{self._release.label}: case years {', '.join(sorted(years))}; expected one year, each in "
                "a folder of its own, since case numbers are given anew every year"
            )
        return int(year)

    def note(self) -> str:
        """See :meth:`FarsCsvSource.notes`."""
        there = [name for name in TABLES if name in self._release.files]
        lacking = [name for name in _WITHOUT if name not in there]
        needed = [name for name in ("accident", "vehicle") if name in lacking]
        if needed:
            files = " and ".join(f"{name}.csv ({_WITHOUT[name]})" for name in needed)
            raise UserError(
                f"{self._release.label}: no crash could be reconstructed without {files} of the same release; put it "
                f"beside it. There are {', '.join(there)}"
            )
        missing = "".join(f"; no {name}: {_WITHOUT[name]}" for name in lacking)
        return f"FARS {self.year}: {', '.join(there)}{missing}"

    @cached_property
    def state_cases(self) -> list[int]:
        """Return ``ST_CASE`` of every crash, in order, from ``accident.csv`` or else from the tables of events."""
        year, accidents = self.year, self._table("accident")  # the year first: stacked ones have each case twice
        if accidents is None:
            events = [table.cases for name in _SEQUENCES if (table := self._table(name)) is not None]
            cases = np.unique(np.concatenate(events))
        else:
            cases = accidents.cases
        twice = cases[1:][cases[1:] == cases[:-1]]
        if twice.size:
            raise UserError(f"{self._release.label}: ST_CASE {twice[0]} has several rows; expected one per crash")
        for outermost in (*cases[:1].tolist(), *cases[-1:].tolist()):
            try:
                crash_key(year, outermost)
            except ValueError as error:
                raise UserError(f"{self._release.label}: {error}") from error
        return [int(case) for case in cases]

    def listings(self) -> Iterator[CrashListing]:
        """Yield one line per crash; only its key if a value cannot be read."""
        for case, rows in self._crashes(self.state_cases, _LISTED):
            key = crash_key(self.year, case)
            try:
                yield list_rows(rows, name=key)
            except Rejection:
                yield CrashListing(key, self.year, case)

    def reports(self, cases: Sequence[int]) -> Iterator[tuple[str, bytes]]:
        """Yield key and rows, as JSON, of the crashes of these cases, in order."""
        for case, rows in self._crashes(cases, dict.fromkeys(self._release.files)):
            yield crash_key(self.year, case), report_to_json(rows)

    def _crashes(
        self, cases: Sequence[int], columns: Mapping[str, Sequence[str] | None]
    ) -> Iterator[tuple[int, FarsRows]]:
        """Yield the rows of each crash in the named tables, with the named columns (None: all)."""
        for start in range(0, len(cases), _BATCH):
            batch = cases[start : start + _BATCH]
            tables = {name: self._rows(name, batch, of) for name, of in columns.items()}
            for case in batch:
                own = {name: rows[case] for name, rows in tables.items() if case in rows}
                yield case, FarsRows(self.year, case, own)

    def _rows(self, name: str, cases: Sequence[int], columns: Sequence[str] | None) -> Rows:
        table = self._table(name)
        rows: Rows = {}
        if table is not None:
            wanted = set(cases)
            for case, row in table.rows(cases[0], cases[-1], columns):
                if case in wanted:
                    rows.setdefault(case, []).append(row)
        return rows

    def _table(self, name: str) -> _SortedTable | None:
        if name not in self._tables:
            table = self._release.table(name)
            self._tables[name] = None if table is None else _SortedTable(table, self._release.files[name].label)
        return self._tables[name]
