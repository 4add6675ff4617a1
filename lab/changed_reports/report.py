"""A report in CrashAPI's elements that can be changed: each fact in all the elements that say it.

Elements and their codes are those of the FARS/CRSS Coding and Validation Manual. Fields that a report lacks are not
added, unless a method says so; the label beside a changed code (``IMPACT1NAME``) goes, since it names the old one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from lxml import etree

from trace_dag.crash.codes.events import VEHICLE_EVENTS
from trace_dag.crash.fields import Fields, local_name
from trace_dag.crash.parse import report_element

_AREAS_OF_PARTIES: Final = (("VNUMBER1", "AOI1"), ("VNUMBER2", "AOI2"))


class ChangedReport:
    """A copy of a report to be changed element by element. ``data`` is a ``GetCaseDetails`` response, or the
    rows of FARS tables.

    Raises :class:`~trace_dag.common.errors.Rejection` for data that is not a report of one crash.
    """

    def __init__(self, data: bytes) -> None:
        self.crash, _ = report_element(data, name="report", repair=True)

    def to_bytes(self) -> bytes:
        """Return the report as XML, UTF-8."""
        return etree.tostring(self.crash.getroottree(), xml_declaration=True, encoding="UTF-8")

    # --- elements ------------------------------------------------------------------------------------------------
    def vehicle(self, number: int) -> etree._Element | None:
        """Return the element of a vehicle in transport, None if no vehicle has this number."""
        return next((each for each in self.vehicles() if code_in(each, "VEH_NO") == number), None)

    def vehicles(self) -> list[etree._Element]:
        """Return the elements of all vehicles in transport."""
        return list(Fields(self.crash, "report").members("Vehicles"))

    def people(self) -> list[etree._Element]:
        """Return the rows of persons outside motor vehicles (``NPersons``)."""
        return self._outside("NPersons")

    def typings(self) -> list[etree._Element]:
        """Return the rows that type what pedestrians and cyclists did (``PbTypes``)."""
        return self._outside("PbTypes")

    def _outside(self, name: str) -> list[etree._Element]:
        rows = Fields(self.crash, "report").members(name)
        return [row for row in rows if code_in(row, "VEH_NO") in (None, 0)]

    def crash_events(self) -> list[etree._Element]:
        """Return every row that says what happened between parties: ``CEvent``, and the ``VEvent`` that repeats it."""
        rows = list(Fields(self.crash, "report").members("CEvents"))
        return rows + [row for each in self.vehicles() for row in Fields(each, "report").members("VEvents")]

    def own_events(self, number: int) -> list[etree._Element]:
        """Return the rows of a vehicle's own sequence (``VSOE``)."""
        return self._rows(number, "Vsoes", "VSOEs")

    def damages(self, number: int) -> list[etree._Element]:
        """Return the rows of a vehicle's damaged areas (``DAMAGE``, before 2020 ``MDAREAS``)."""
        return self._rows(number, "Damages")

    def _rows(self, number: int, *lists: str) -> list[etree._Element]:
        vehicle = self.vehicle(number)
        return [] if vehicle is None else list(Fields(vehicle, "report").members(*lists))

    # --- what several elements say together ------------------------------------------------------------------------
    def change_areas(self, number: int, change: Callable[[int], int]) -> None:
        """Let ``change`` replace every area of a vehicle's body: initial impact, areas of its events, damage."""
        for element, name in self._areas(number):
            area = code_in(element, name)
            if area is not None:
                put(element, name, change(area))

    def _areas(self, number: int) -> Iterator[tuple[etree._Element, str]]:
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
        lists = [next((e for e in each if _is(e, "Damages")), None) for each in (first, second)]
        if lists[0] is not None and lists[1] is not None:
            rows = [list(each) for each in lists if each is not None]
            for element, number, moved in ((lists[0], one, rows[1]), (lists[1], two, rows[0])):
                element[:] = moved
                for row in moved:
                    put(row, "VEH_NO", number)

    def everywhere(self, name: str, code: int) -> None:
        """Put a code into an element of the crash that the rows of its vehicles repeat (``MAN_COLL``, ``HARM_EV``)."""
        for element in (self.crash, *self.vehicles()):
            put(element, name, code)


def code_in(element: etree._Element, *names: str) -> int | None:
    """Return the number in the first of the named children that has one.

    >>> code_in(etree.fromstring("<Vehicle><VEH_NO>2</VEH_NO></Vehicle>"), "VEH_NO")
    2
    """
    return Fields(element, "report").integer(*names)


def text_in(element: etree._Element, name: str) -> str:
    """Return the text of the first child of that name, "" if there is none.

    >>> text_in(etree.fromstring("<Crash><TWAY_ID>MAIN ST</TWAY_ID></Crash>"), "TWAY_ID")
    'MAIN ST'
    """
    return Fields(element, "report").text(name)


def put(element: etree._Element, name: str, value: object) -> bool:
    """Put a value into a child that is there, and take its label away; whether there is such a child.

    >>> vehicle = etree.fromstring("<Vehicle><IMPACT1>3</IMPACT1><IMPACT1NAME>3 Clock Point</IMPACT1NAME></Vehicle>")
    >>> put(vehicle, "IMPACT1", 9), put(vehicle, "TRAV_SP", 30), etree.tostring(vehicle)
    (True, False, b'<Vehicle><IMPACT1>9</IMPACT1></Vehicle>')
    """
    child = next((each for each in element if _is(each, name) and len(each) == 0), None)
    if child is None:
        return False
    if child.text != str(value):
        child.text = str(value)
        remove(element, f"{name}NAME")
    return True


def exchange(one: etree._Element, two: etree._Element, name: str) -> None:
    """Exchange a number between two elements that both have it.

    >>> one, two = (etree.fromstring(f"<Vehicle><TRAV_SP>{mph}</TRAV_SP></Vehicle>") for mph in (14, 30))
    >>> exchange(one, two, "TRAV_SP")
    >>> code_in(one, "TRAV_SP"), code_in(two, "TRAV_SP")
    (30, 14)
    """
    first, second = code_in(one, name), code_in(two, name)
    if first is not None and second is not None:
        put(one, name, second)
        put(two, name, first)


def remove(element: etree._Element, *names: str) -> None:
    """Take children away, whatever they hold.

    >>> vehicle = etree.fromstring("<Vehicle><MODEL>42</MODEL><TRAV_SP>30</TRAV_SP></Vehicle>")
    >>> remove(vehicle, "MODEL")
    >>> [child.tag for child in vehicle]
    ['TRAV_SP']
    """
    for child in list(element):
        if _is(child, *names):
            element.remove(child)


def keep(element: etree._Element, names: Sequence[str]) -> None:
    """Take all children away but the named ones.

    >>> vehicle = etree.fromstring("<Vehicle><VEH_NO>1</VEH_NO><TRAV_SP>30</TRAV_SP></Vehicle>")
    >>> keep(vehicle, ("VEH_NO",))
    >>> [child.tag for child in vehicle]
    ['VEH_NO']
    """
    for child in list(element):
        if not _is(child, *names):
            element.remove(child)


def add(element: etree._Element, name: str, value: object = "") -> etree._Element:
    """Return a new last child.

    >>> vehicle = etree.fromstring("<Vehicle><VEH_NO>1</VEH_NO></Vehicle>")
    >>> code_in(vehicle, "ACC_TYPE"), add(vehicle, "ACC_TYPE", 50).text, code_in(vehicle, "ACC_TYPE")
    (None, '50', 50)
    """
    child = etree.SubElement(element, name)
    child.text = str(value) if value != "" else None
    return child


def _is(element: etree._Element, *names: str) -> bool:
    return isinstance(element.tag, str) and local_name(element).upper() in {name.upper() for name in names}
