"""The rows that the tables of a FARS release have of one crash: kept as they are, and read as CrashAPI's elements.

A column becomes an element of the same name, a row a member of one of CrashAPI's lists; older names and codes are
translated where reports are read. The tables are the subject of :mod:`trace_dag.crash.fars.files`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from lxml import etree

from trace_dag.crash.keys import state_of

Row: TypeAlias = dict[str, str]
"""The values of a row that are not blank, by column."""

_VEHICLE_LISTS: Final = {
    "person": ("Persons", "Person"),
    "damage": ("Damages", "Damage"),
    "vpicdecode": ("VinDeriveds", "VINDerived"),
    "maneuver": ("Maneuvers", "Maneuver"),
    "vevent": ("VEvents", "VEvent"),
    "vsoe": ("Vsoes", "VSOEs"),
}
_SEQUENCE_LISTS: Final = {name: _VEHICLE_LISTS[name] for name in ("vevent", "vsoe")}
_TELLING_TABLES: Final = ("vsoe", "vevent", "maneuver", "damage")
"""Tables that tell of vehicles by ``VEH_NO`` above 0: the events of all, the others of those in transport."""
_CRASH_LISTS: Final = {
    "weather": ("Weathers", "Weather"),
    "cevent": ("CEvents", "CEvent"),
    "pbtype": ("PbTypes", "PBType"),
    "nmprior": ("NmPriors", "NMPrior"),
    "nmcrash": ("NmCrashes", "NMCrash"),
    "safetyeq": ("SafetyEQs", "SafetyEQ"),
}
_NOT_XML: Final = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_INTEGER: Final = re.compile(r"[0-9]{1,9}(?:\.0*)?")


@dataclass(frozen=True)
class FarsRows:
    """Rows of a release about one crash, by table name in lower case.

    >>> FarsRows(2015, 40036, {"accident": [{"ST_CASE": "40036", "FATALS": "1"}]}).element().findtext("FATALS")
    '1'
    """

    case_year: int
    state_case: int
    tables: Mapping[str, list[Row]]

    def element(self) -> etree._Element:
        """Return the ``CrashResultSet`` that CrashAPI would serve of this crash.

        Raises ValueError for a column whose name no element can have, and for a number of no state's.
        """
        crash = etree.Element("CrashResultSet")
        _scalars(crash, {"CaseYear": str(self.case_year)})
        for row in self._rows("accident") or [
            {"STATE": str(state_of(self.state_case)), "ST_CASE": str(self.state_case)}
        ]:
            _scalars(crash, row)
        vehicles = etree.SubElement(crash, "Vehicles")
        for row in self._vehicles():
            self._add_vehicle(vehicles, "Vehicle", row, _VEHICLE_LISTS)
        for name, (members, member) in _CRASH_LISTS.items():
            _list(crash, members, member, _by_number(self._rows(name), "EVENTNUM"))
        standing = _by_number(self._rows("parkwork"), "VEH_NO")
        if standing:
            parked = etree.SubElement(crash, "ParkWorks")
        for row in standing:
            self._add_vehicle(parked, "ParkWork", row, _SEQUENCE_LISTS)
        outside = [row for row in self._rows("person") if integer(row, "VEH_NO") in (None, 0)]
        _list(crash, "NPersons", "Person", outside)
        return crash

    def _rows(self, table: str) -> list[Row]:
        return self.tables.get(table, [])

    def _add_vehicle(self, parent: etree._Element, name: str, row: Row, lists: Mapping[str, tuple[str, str]]) -> None:
        """Add one vehicle with its facts from the tables that ``lists`` names."""
        vehicle = etree.SubElement(parent, name)
        _scalars(vehicle, row)
        number = integer(row, "VEH_NO")
        for table, (members, member) in lists.items():
            own = [each for each in self._rows(table) if number is not None and integer(each, "VEH_NO") == number]
            _list(vehicle, members, member, own)

    def _vehicles(self) -> list[Row]:
        """Return the rows of the vehicles in transport, and a bare number for those that only other tables tell of.

        Reading a report decides whether such a vehicle was moving or parked."""
        rows = self._rows("vehicle")
        known = {integer(row, "VEH_NO") for row in (*rows, *self._rows("parkwork"))}
        told_of = {integer(row, "VEH_NO") for name in _TELLING_TABLES for row in self._rows(name)}
        return _by_number([*rows, *({"VEH_NO": str(number)} for number in told_of - known if number)], "VEH_NO")


def integer(row: Row, name: str) -> int | None:
    """Return a column's whole number (``7``, or pandas' ``7.0``), None for anything else.

    >>> integer({"VEH_NO": "2.0"}, "VEH_NO")
    2
    """
    value = row.get(name, "")
    return int(value.split(".")[0]) if _INTEGER.fullmatch(value) else None


def _scalars(parent: etree._Element, row: Row) -> None:
    for name, value in row.items():
        etree.SubElement(parent, name).text = _NOT_XML.sub("", value)


def _list(parent: etree._Element, members: str, member: str, rows: list[Row]) -> None:
    if rows:
        element = etree.SubElement(parent, members)
        for row in rows:
            _scalars(etree.SubElement(element, member), row)


def _by_number(rows: Iterable[Row], column: str) -> list[Row]:
    return sorted(rows, key=lambda row: integer(row, column) or 0)
