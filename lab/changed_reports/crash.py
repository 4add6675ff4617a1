"""Changes to a report's values of the whole crash and of the road.

Each function changes the report in place and returns the change in words; None where it does not apply.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from lab.changed_reports.report import ChangedReport, code_in, keep, put
from lab.changed_reports.scene import PerturbedScene
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.messages.wording import count_of
from trace_dag.crash.codes.elements import MOTOR_VEHICLE_IN_TRANSPORT, NO_SECOND_VEHICLE, TYP_INT
from trace_dag.crash.fields import Row

TREE: Final = 42
_NO_MOTOR_VEHICLE_AREA: Final = 77
_MADE_UP: Final = ("VORBECK", "QUILLMERE", "TARNWOLD", "ZABRINSKE", "OSTREGARD", "HELVENNY", "PRUITTMOOR", "YNGVESTEAD")
_TYPES: Final = ("RD", "ST", "AVE", "LN", "DR", "BLVD")
_ALIGNMENT: Final = {1: 2, 2: 1, 3: 1, 4: 1}
_MIRRORED_ALIGNMENT: Final = {2: 3, 3: 2}


# --- place -----------------------------------------------------------------------------------------------------------
def move(report: ChangedReport, scene: PerturbedScene, *, east_m: float, north_m: float) -> str | None:
    """Return the position, so far from the reported one.

    >>> move(ChangedReport(report_xml), perturbed_scene, east_m=0.0, north_m=100.0)  # reported at 41.830333
    'at 41.831234, -101.536875'
    """
    frame = LocalFrame(scene.record.latitude_deg, scene.record.longitude_deg)
    latitude_deg, longitude_deg = frame.to_geographic(np.array([east_m, north_m])).tolist()
    return _put_place(report, latitude_deg, longitude_deg)


def at_point(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return the position, at the point drawn for the scene.

    >>> from lab.changed_reports.scene import Point
    >>> scene = PerturbedScene(record, perturbed_scene.rng, Point(41.83, -101.54, 260.0, ("Oak Street",), False))
    >>> at_point(ChangedReport(report_xml), scene)
    'at 41.830000, -101.540000, 260 m away, on Oak Street'
    """
    point = scene.point
    if point is None:
        return None
    where = _put_place(report, point.latitude_deg, point.longitude_deg)
    return f"{where}, {point.distance_m:.0f} m away, on {' / '.join(point.names) or 'a street without a name'}"


def _put_place(report: ChangedReport, latitude_deg: float, longitude_deg: float) -> str | None:
    put(report.crash, "LATITUDE", f"{latitude_deg:.8f}")
    if not (
        put(report.crash, "LONGITUD", f"{longitude_deg:.8f}") or put(report.crash, "LONGITUDE", f"{longitude_deg:.8f}")
    ):
        return None
    return f"at {latitude_deg:.6f}, {longitude_deg:.6f}"


def set_down(report: ChangedReport, scene: PerturbedScene, *, named_here: bool) -> str | None:
    """Return another crash's report at the place of this one, with its own street names or (``named_here``) this one's.

    >>> report = ChangedReport(report_xml)
    >>> set_down(report, perturbed_scene, named_here=True), report.crash["TWAY_ID2"]
    ('at 41.830333, -101.536875', 'ELDER ST')
    """
    record = scene.record
    where = _put_place(report, record.latitude_deg, record.longitude_deg)
    if named_here:
        for name, street in (("TWAY_ID", record.trafficway_1), ("TWAY_ID2", record.trafficway_2)):
            if not put(report.crash, name, street):
                report.crash[name] = street
    return where


# --- streets ---------------------------------------------------------------------------------------------------------
def made_up_names(report: ChangedReport, scene: PerturbedScene, *, elements: tuple[str, ...]) -> str | None:
    """Return names that no street has, drawn for ``TWAY_ID`` or for it and ``TWAY_ID2``, where a name is reported."""
    words = scene.rng.permutation(_MADE_UP)
    names = [f"{word} {scene.rng.choice(_TYPES)}" for word in words[: len(elements)]]
    reported = {"TWAY_ID": scene.record.trafficway_1, "TWAY_ID2": scene.record.trafficway_2}
    given = [(element, name) for element, name in zip(elements, names, strict=True) if reported[element]]
    if len(given) < len(elements):
        return None
    for element, name in given:
        put(report.crash, element, name)
    return " and ".join(name for _, name in given)


def name_street(report: ChangedReport, scene: PerturbedScene, *, name: str) -> str | None:
    """Return ``TWAY_ID``.

    >>> report = ChangedReport(report_xml)
    >>> name_street(report, perturbed_scene, name="I-999"), report.crash["TWAY_ID"]
    ('I-999', 'I-999')
    """
    return name if scene.record.trafficway_1 and put(report.crash, "TWAY_ID", name) else None


def set_intersection(report: ChangedReport, scene: PerturbedScene, *, kind: int, junction: int) -> str | None:
    """Return ``TYP_INT``, and ``RELJCT2`` so that the two agree.

    >>> report = ChangedReport(report_xml)
    >>> set_intersection(report, perturbed_scene, kind=6, junction=2), report.crash["TYP_INT"]
    ('a roundabout', '6')
    """
    if not put(report.crash, "TYP_INT", kind):
        return None
    put(report.crash, "RELJCT2", junction)
    return TYP_INT.meaning(kind)


# --- road ------------------------------------------------------------------------------------------------------------
def set_road(
    report: ChangedReport,
    scene: PerturbedScene,
    *,
    interstate: bool = False,
    lanes: int | None = None,
    limit_mph: int | None = None,
) -> str | None:
    """Set the kind of road: an interstate (``FUNC_SYS``, ``ROAD_FNC``, ``ROUTE``), so many lanes, such a limit.

    >>> report = ChangedReport(report_xml)
    >>> set_road(report, perturbed_scene, lanes=6), [code_in(vehicle, "VNUM_LAN") for vehicle in report.vehicles()]
    ('6 lanes', [6, 6])
    """
    done = []
    if interstate:
        urban = scene.record.rural_urban_code == 2
        done.append(put(report.crash, "FUNC_SYS", 1) | put(report.crash, "ROAD_FNC", 11 if urban else 1))
        put(report.crash, "ROUTE", 1)
    for element, value in (("VNUM_LAN", lanes), ("VSPD_LIM", limit_mph)):
        if value is not None:
            done += [put(vehicle, element, value) for vehicle in _vehicles(report, scene)]
    if not any(done):
        return None
    lanes_said = count_of(lanes, "lane") if lanes else ""
    said = ("an interstate" * interstate, lanes_said, f"{limit_mph} mph" * bool(limit_mph))
    return ", ".join(word for word in said if word)


def mirror_alignment(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``VALIGN``: a curve to the left for one to the right, and the other way round."""
    return _align(report, scene, _MIRRORED_ALIGNMENT, "curves the other way")


def other_alignment(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``VALIGN``: a curve to the right for a straight road, straight for a curve.

    >>> report = ChangedReport(report_xml)
    >>> other_alignment(report, perturbed_scene), [code_in(vehicle, "VALIGN") for vehicle in report.vehicles()]
    ('curved for straight, straight for curved', [2, 2])
    """
    return _align(report, scene, _ALIGNMENT, "curved for straight, straight for curved")


def _align(report: ChangedReport, scene: PerturbedScene, to: dict[int, int], words: str) -> str | None:
    changed = False
    for vehicle in _vehicles(report, scene):
        code = code_in(vehicle, "VALIGN")
        if code in to:
            changed |= put(vehicle, "VALIGN", to[code])
    return words if changed else None


def _vehicles(report: ChangedReport, scene: PerturbedScene) -> list[Row]:
    found = [report.vehicle(number) for number in scene.vehicles]
    return [vehicle for vehicle in found if vehicle is not None]


# --- what happened ---------------------------------------------------------------------------------------------------
def set_manner(report: ChangedReport, scene: PerturbedScene, *, code: int) -> str | None:
    """Return ``MAN_COLL`` of the crash and where its vehicles repeat it.

    >>> report = ChangedReport(report_xml)
    >>> set_manner(report, perturbed_scene, code=10), code_in(report.crash, "MAN_COLL")
    ('MAN_COLL 10', 10)
    """
    report.everywhere("MAN_COLL", code)
    return f"MAN_COLL {code}"


def tree_as_first_harm(report: ChangedReport, scene: PerturbedScene) -> str | None:
    """Return ``HARM_EV`` a tree, of the crash and where its vehicles repeat it; the events stay.

    >>> report = ChangedReport(report_xml)
    >>> tree_as_first_harm(report, perturbed_scene), code_in(report.crash, "HARM_EV")
    ('HARM_EV: a tree', 42)
    """
    report.everywhere("HARM_EV", TREE)
    return "HARM_EV: a tree"


def tree_as_first_event(report: ChangedReport, scene: PerturbedScene, *, partner_stays: bool = False) -> str | None:
    """Return the first event a tree: in the crash's sequence, in the vehicles' copies of it and in their own sequences.

    Its second party is then none, unless ``partner_stays``: a slip in the code alone.

    >>> report = ChangedReport(report_xml)
    >>> tree_as_first_event(report, perturbed_scene), code_in(report.crash_events()[0], "SOE")
    ('first event: a tree', 42)
    """
    rows = report.crash_events()
    first = min((number for row in rows if (number := code_in(row, "EVENTNUM"))), default=None)
    changed = False
    for row in rows:
        if code_in(row, "EVENTNUM") == first:
            changed |= put(row, "SOE", TREE)
            if not partner_stays:
                put(row, "VNUMBER2", max(NO_SECOND_VEHICLE))
                put(row, "AOI2", _NO_MOTOR_VEHICLE_AREA)
    for number in scene.pair:
        own = [row for row in report.own_events(number) if code_in(row, "SOE") == MOTOR_VEHICLE_IN_TRANSPORT][:1]
        for row in own:
            changed |= put(row, "SOE", TREE)
    return "first event: a tree" if changed else None


def blank(report: ChangedReport, scene: PerturbedScene, *, head_on: bool = False, named: bool = False) -> str | None:
    """Return nothing left but the place (position, kind of intersection) and that the two vehicles collided.

    With ``named`` the street names stay too, with ``head_on`` both crash types say head-on (50 and 51).

    >>> report = ChangedReport(report_xml)
    >>> blank(report, perturbed_scene, head_on=True), [code_in(vehicle, "ACC_TYPE") for vehicle in report.vehicles()]
    ('only the place, head-on types', [50, 51])
    """
    crash = report.crash
    place = ("LATITUDE", "LONGITUD", "LONGITUDE", "TYP_INT", "RELJCT2", *(("TWAY_ID", "TWAY_ID2") if named else ()))
    keep(crash, "CASEYEAR", "YEAR", "STATE", "ST_CASE", "VE_FORMS", "VE_TOTAL", *place)
    for vehicle in report.vehicles():
        keep(vehicle, "VEH_NO")
    one, two = scene.pair
    event = {"EVENTNUM": 1, "VNUMBER1": one, "SOE": MOTOR_VEHICLE_IN_TRANSPORT, "VNUMBER2": two}
    said = {name: str(value) for name, value in event.items()}
    report.tables = {"accident": [crash], "vehicle": report.vehicles(), "cevent": [said]}
    if head_on:
        for number, code in ((one, 50), (two, 51)):
            row = report.vehicle(number)
            if row is None:
                return None
            row["ACC_TYPE"] = str(code)
    return "only the place" + ", street names" * named + ", head-on types" * head_on
