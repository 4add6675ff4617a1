"""Changes to a report's values of people: the side they came from, their direction and place, and their striker.

The changes are like those of vehicles (:mod:`lab.changed_reports.vehicles`). Fields typed at or near intersections
only are changed where they are there."""

from __future__ import annotations

from typing import Final

from lab.changed_reports.report import ChangedReport, code_in, put, remove
from lab.changed_reports.scene import PerturbedScene
from trace_dag.crash.codes.elements import CYCLIST, PEDESTRIAN, PERSON_ON_CONVEYANCE

_OTHER_SIDE: Final = {"a": "b", "b": "a"}  # PEDSNR
_OPPOSITE: Final = {1: 3, 3: 1, 2: 4, 4: 2}  # PEDDIR
_ALONG: Final = {"PEDCTYPE": (410, 400), "BIKECTYPE": (231, 230)}
"""Type and group: walking along the road, struck from behind; a cyclist overtaken."""
_GROUP: Final = {"PEDCTYPE": "PEDCGP", "BIKECTYPE": "BIKECGP"}
_NO_SUCH_PERSON: Final = (None, 0)  # PEDCTYPE of a cyclist, BIKECTYPE of a pedestrian
_ON_SIDEWALK: Final = {"PEDPOS": 5, "BIKEPOS": 4, "LOCATION": 21}
_NOT_THEIRS: Final = (None, 0, 7)
_STRIKES: Final = (PEDESTRIAN, CYCLIST, PERSON_ON_CONVEYANCE)


def mirror_sides(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the side from which the person came: ``PEDSNR`` a for b, ``PEDDIR`` turned round.

    >>> report = ChangedReport(pedestrian_xml)
    >>> (row,) = report.typings()
    >>> put(row, "PEDSNR", "1a"), mirror_sides(report, perturbed_scene), row["PEDSNR"]
    (True, 'the person from the other side', '1b')
    """
    changed = False
    for row in report.typings():
        scenario, way = row.get("PEDSNR", ""), code_in(row, "PEDDIR")
        if scenario[-1:] in _OTHER_SIDE:
            changed |= put(row, "PEDSNR", scenario[:-1] + _OTHER_SIDE[scenario[-1]])
        if way in _OPPOSITE:
            changed |= put(row, "PEDDIR", _OPPOSITE[way])
    return "the person from the other side" if changed else None


def go_along(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the typed as going along the road and struck from behind, whatever the person did.

    >>> report = ChangedReport(pedestrian_xml)
    >>> go_along(report, perturbed_scene), [code_in(row, "PEDCTYPE") for row in report.typings()]
    ('the person along the road', [410])
    """
    changed = False
    for row in report.typings():
        for element, (kind, group) in _ALONG.items():
            if code_in(row, element) not in _NO_SUCH_PERSON:
                changed |= put(row, element, kind) | put(row, _GROUP[element], group)
                remove(row, "PEDSNR", "PEDSNRNAME")
    return "the person along the road" if changed else None


def on_sidewalk(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``PEDPOS``, ``BIKEPOS`` and ``LOCATION``: on a sidewalk.

    >>> report = ChangedReport(pedestrian_xml)
    >>> on_sidewalk(report, perturbed_scene), [code_in(row, "PEDPOS") for row in report.typings()]
    ('the person on a sidewalk', [5])
    """
    changed = False
    for row in (*report.typings(), *report.people()):
        for element, code in _ON_SIDEWALK.items():
            if code_in(row, element) not in _NOT_THEIRS:
                changed |= put(row, element, code)
    return "the person on a sidewalk" if changed else None


def swap_strikes(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the vehicles of the first two strikes exchanged, in all rows that say what happened between parties."""
    if len(scene.vehicles) < 2:
        return None
    one, two = scene.vehicles[:2]
    other = {one: two, two: one}
    changed = False
    for row in report.crash_events():
        if code_in(row, "SOE") in _STRIKES and (number := code_in(row, "VNUMBER1")) in other:
            changed |= put(row, "VNUMBER1", other[number])
    return f"strikes of vehicles {one} and {two} exchanged" if changed else None
