"""A report in the rows of FARS' tables that can be changed: each fact in all the rows that say it.

Columns and their codes are those of the FARS/CRSS Coding and Validation Manual. Values that a report lacks are not
added, unless a method says so; the label beside a changed code (``IMPACT1NAME``) goes, since it names the old one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from typing import Final

from trace_dag.crash.codes.elements import VEHICLE_EVENTS
from trace_dag.crash.fars.rows import FarsRows
from trace_dag.crash.fields import Fields, Row, malformed
from trace_dag.crash.parse import open_report, report_to_json

_AREAS_OF_PARTIES: Final = (("VNUMBER1", "AOI1"), ("VNUMBER2", "AOI2"))


class ChangedReport:
    """A copy of a report to be changed value by value. ``data`` is a ``GetCaseDetails`` response, or the
    rows of FARS tables.

    Raises :class:`~trace_dag.common.errors.Rejection` for data that is not a report of one crash.
    """

    def __init__(self, data: bytes) -> None:
        report, _ = open_report(data, name="report", repair=True)
        if not isinstance(report, FarsRows):
            raise malformed("report is the record of another register; expected FARS' own words")
        self._report = report
        self.tables = deepcopy(dict(report.tables))

    def to_bytes(self) -> bytes:
        """Return the report as JSON."""
        return report_to_json(FarsRows(self._report.case_year, self._report.state_case, self.tables))

    # --- rows ----------------------------------------------------------------------------------------------------
    @property
    def crash(self) -> Row:
        """Return the row of the crash itself."""
        return self.tables["accident"][0]

    def vehicle(self, number: int) -> Row | None:
        """Return the row of a vehicle in transport, None if no vehicle has this number."""
        return next((each for each in self.vehicles() if code_in(each, "VEH_NO") == number), None)

    def vehicles(self) -> list[Row]:
        """Return the rows of all vehicles in transport."""
        return self._rows("vehicle")

    def people(self) -> list[Row]:
        """Return the rows of persons outside motor vehicles."""
        return [row for row in self._rows("person") if code_in(row, "VEH_NO") in (None, 0)]

    def typings(self) -> list[Row]:
        """Return the rows that type what pedestrians and cyclists did."""
        return [row for row in self._rows("pbtype") if code_in(row, "VEH_NO") in (None, 0)]

    def crash_events(self) -> list[Row]:
        """Return every row of an event between parties: ``CEvent``, and the ``VEvent`` that repeats it."""
        return [*self._rows("cevent"), *self._rows("vevent")]

    def own_events(self, number: int) -> list[Row]:
        """Return the rows of a vehicle's own sequence (``VSOE``)."""
        return self.rows_of_vehicle("vsoe", number)

    def damages(self, number: int) -> list[Row]:
        """Return the rows of a vehicle's damaged areas (``DAMAGE``, before 2020 ``MDAREAS``)."""
        return self.rows_of_vehicle("damage", number)

    def _rows(self, table: str) -> list[Row]:
        return self.tables.get(table, [])

    def rows_of_vehicle(self, table: str, number: int) -> list[Row]:
        """Return the rows of a table that are about a vehicle."""
        return [row for row in self._rows(table) if code_in(row, "VEH_NO") == number]

    # --- what several rows say together ----------------------------------------------------------------------------
    def change_areas(self, number: int, change: Callable[[int], int]) -> None:
        """Let ``change`` replace every area of a vehicle's body: initial impact, areas of its events, damage."""
        for row, name in self._areas(number):
            area = code_in(row, name)
            if area is not None:
                put(row, name, change(area))

    def _areas(self, number: int) -> Iterator[tuple[Row, str]]:
        vehicle = self.vehicle(number)
        if vehicle is not None:
            yield vehicle, "IMPACT1"
        for row in self.crash_events():
            for party, area in _AREAS_OF_PARTIES:
                if code_in(row, party) == number:
                    yield row, area
        for row in self.own_events(number):
            yield row, "AOI"
        for row in self.damages(number):
            yield row, "DAMAGE"
            yield row, "MDAREAS"

    def swap_areas(self, one: int, two: int) -> None:
        """Exchange the areas of two vehicles: initial impacts, areas of the collisions of the two, damage."""
        first, second = self.vehicle(one), self.vehicle(two)
        if first is None or second is None:
            return
        exchange(first, second, "IMPACT1")
        for row in self.crash_events():
            if {code_in(row, "VNUMBER1"), code_in(row, "VNUMBER2")} == {one, two}:
                areas = code_in(row, "AOI1"), code_in(row, "AOI2")
                if areas[0] is not None and areas[1] is not None:
                    put(row, "AOI1", areas[1])
                    put(row, "AOI2", areas[0])
        collisions = [
            [row for row in self.own_events(number) if code_in(row, "SOE") in VEHICLE_EVENTS] for number in (one, two)
        ]
        for mine, theirs in zip(*collisions, strict=False):
            exchange(mine, theirs, "AOI")
        damages = self.damages(one), self.damages(two)
        if all(damages):
            for rows, number in zip(damages, (two, one), strict=True):
                for row in rows:
                    put(row, "VEH_NO", number)

    def everywhere(self, name: str, code: int) -> None:
        """Put a code into the row of the crash and those of its vehicles that repeat it (``MAN_COLL``, ``HARM_EV``)."""
        for row in (self.crash, *self.vehicles()):
            put(row, name, code)


def code_in(row: Row, *names: str) -> int | None:
    """Return the number in the first of the named columns that has one.

    >>> code_in({"VEH_NO": "2"}, "VEH_NO")
    2
    """
    return Fields(row, "report").integer(*names)


def put(row: Row, name: str, value: object) -> bool:
    """Put a value into a column that has one, and take its label away; whether there is such a column.

    >>> vehicle = {"IMPACT1": "3", "IMPACT1NAME": "3 Clock Point"}
    >>> put(vehicle, "IMPACT1", 9), put(vehicle, "TRAV_SP", 30), vehicle
    (True, False, {'IMPACT1': '9'})
    """
    if name not in row:
        return False
    if row[name] != str(value):
        row[name] = str(value)
        remove(row, f"{name}NAME")
    return True


def exchange(one: Row, two: Row, name: str) -> None:
    """Exchange a number between two rows that both have it.

    >>> one, two = {"TRAV_SP": "14"}, {"TRAV_SP": "30"}
    >>> exchange(one, two, "TRAV_SP")
    >>> code_in(one, "TRAV_SP"), code_in(two, "TRAV_SP")
    (30, 14)
    """
    first, second = code_in(one, name), code_in(two, name)
    if first is not None and second is not None:
        put(one, name, second)
        put(two, name, first)


def remove(row: Row, *names: str) -> None:
    """Take columns away, whatever they hold."""
    for name in names:
        row.pop(name, None)


def keep(row: Row, *names: str) -> None:
    """Take all columns away but the named ones.

    >>> vehicle = {"VEH_NO": "1", "TRAV_SP": "30"}
    >>> keep(vehicle, "VEH_NO")
    >>> vehicle
    {'VEH_NO': '1'}
    """
    remove(row, *(row.keys() - set(names)))
