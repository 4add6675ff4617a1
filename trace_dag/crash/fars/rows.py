"""The rows of one crash in the tables of a FARS release, the form in which every FARS report is read.

CrashAPI's XML is turned into it: a list is a table, an element a row. Older names and codes are translated where
reports are read. The tables are the subject of :mod:`trace_dag.crash.fars.files`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from lxml import etree

from trace_dag.crash.fields import MAX_MEMBERS, Fields, Row, malformed, whole_number
from trace_dag.crash.keys import state_of
from trace_dag.crash.xml_input import local_name, values_of

_TELLING_TABLES: Final = ("vsoe", "vevent", "maneuver", "damage")
"""Tables that tell of vehicles by ``VEH_NO`` above 0: the events of all, the others of those in transport."""
_TABLE_OF_LIST: Final = {
    "VEHICLES": "vehicle",
    "PARKWORKS": "parkwork",
    "PERSONS": "person",
    "NPERSONS": "person",
    "DAMAGES": "damage",
    "VINDERIVEDS": "vpicdecode",
    "VINDECODES": "vpicdecode",
    "MANEUVERS": "maneuver",
    "VEVENTS": "vevent",
    "VSOES": "vsoe",
    "WEATHERS": "weather",
    "CEVENTS": "cevent",
    "PBTYPES": "pbtype",
    "NMPRIORS": "nmprior",
    "NMCRASHES": "nmcrash",
    "SAFETYEQS": "safetyeq",
    "VIOLATIONS": "violatn",
    "DRIVERRFS": "driverrf",
    "DRIERRFS": "driverrf",  # the service's spelling
}
"""Lists of CrashAPI, of a crash or of a vehicle, and the tables that have their rows."""


@dataclass(frozen=True)
class FarsRows:
    """Rows of a release about one crash, by table name in lower case.

    >>> FarsRows(2015, 40036, {"accident": [{"ST_CASE": "40036", "FATALS": "1"}]}).fields("a report").integer("FATALS")
    1
    """

    case_year: int
    state_case: int
    tables: Mapping[str, list[Row]]

    def fields(self, where: str) -> Fields:
        """Return the values of the crash itself, with the other tables, ordered by their numbers."""
        crash: Row = {"CASEYEAR": str(self.case_year)}
        known = {"STATE": str(state_of(self.state_case)), "ST_CASE": str(self.state_case)}
        for row in (*self._rows("accident"), known):
            crash = row | crash
        in_order = {
            "vehicle": self._vehicles(),
            "parkwork": _by_number(self._rows("parkwork"), "VEH_NO"),
            "cevent": _by_number(self._rows("cevent"), "EVENTNUM"),
        }
        return Fields(crash, where, tables={**self.tables, **in_order})

    def _rows(self, table: str) -> list[Row]:
        return self.tables.get(table, [])

    def _vehicles(self) -> list[Row]:
        """Return the rows of the vehicles in transport, with bare numbers for those that only other tables name.

        Reading the report decides later whether a bare number was moving or parked.
        """
        rows = self._rows("vehicle")
        known = {whole_number(row, "VEH_NO") for row in (*rows, *self._rows("parkwork"))}
        told_of = {whole_number(row, "VEH_NO") for name in _TELLING_TABLES for row in self._rows(name)}
        return _by_number([*rows, *({"VEH_NO": str(number)} for number in told_of - known if number)], "VEH_NO")


def tables_of(crash: etree._Element, *, name: str) -> dict[str, list[Row]]:
    """Return the tables in a ``CrashResultSet``.

    Raises :class:`~trace_dag.common.errors.Rejection` (``malformed_report``) for a list longer than any report's.

    >>> vehicle = "<Vehicle><VEH_NO>1</VEH_NO><Damages><Damage><DAMAGE>12</DAMAGE></Damage></Damages></Vehicle>"
    >>> tables_of(etree.fromstring(f"<CrashResultSet><Vehicles>{vehicle}</Vehicles></CrashResultSet>"), name="a")
    {'accident': [{}], 'vehicle': [{'VEH_NO': '1'}], 'damage': [{'VEH_NO': '1', 'DAMAGE': '12'}]}
    """
    tables = {"accident": [values_of(crash)]}

    def add_lists(element: etree._Element, vehicle: Row) -> None:
        for child in element:
            table = _TABLE_OF_LIST.get(local_name(child).upper(), "") if isinstance(child.tag, str) else ""
            if table and len(child) > MAX_MEMBERS:
                raise malformed(f"{name}: {local_name(child)} has {len(child)} entries; expected {MAX_MEMBERS} at most")
            for member in child if table else ():
                row = vehicle | values_of(member)
                tables.setdefault(table, []).append(row)
                add_lists(member, {name: row[name] for name in ("VEH_NO",) if name in row})

    add_lists(crash, {})
    return tables


def _by_number(rows: Iterable[Row], column: str) -> list[Row]:
    return sorted(rows, key=lambda row: whole_number(row, column) or 0)
