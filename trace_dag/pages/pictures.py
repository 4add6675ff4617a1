"""The pictures of a crash: two views of the ground side by side, north up, with a headline and a legend.

The usual picture shows the approach (from the start of the reconstruction) and the impact (close up): the road with its
lanes, the paths, the bodies at contact and at rest, the reported point. Unknown values are left out, so it can be drawn
after any stage from ``road_map`` on. The picture of a crash that is rejected for its map shows all relevant streets
around the reported point. There OpenStreetMap's lines are drawn over the map made from them, so that differences are
visible.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.common.units import mps_to_mph
from trace_dag.crash.parties import is_vehicle, party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import classes_in_words, conditions_in_words, is_dark
from trace_dag.osm.road_classes import is_drivable
from trace_dag.osm.types import OsmExtract, OsmFeature
from trace_dag.pages.canvas import Canvas, Ink
from trace_dag.pages.map_ground import MINOR_SURFACE
from trace_dag.pages.map_scene import Window
from trace_dag.pages.maps import MapDrawing
from trace_dag.pages.picture_motion import DrawnMotion, draw_cross, draw_reported_point
from trace_dag.pages.picture_sheet import Sheet, Sign, around, square
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport, NearStreet, RejectedMapReport
from trace_dag.scenario.drawn_shapes import (
    CONTACT_COLOUR,
    OBJECT_COLOUR,
    REPORTED_COLOUR,
    is_ours,
    names,
    vehicle_colour,
)
from trace_dag.simulation.states import Hypothesis, StateEstimate
from trace_dag.simulation.types import SimulationLog, overturned_at
from trace_dag.verdict.in_words import label_in_words
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray

WIDTH_PX: Final = 1170
"""Size of the picture as pixels."""
_IMPACT_HALF_WINDOW_M: Final = 16.0
_STRIKE_HALF_WINDOW_M: Final = 8.0  # of a person, who is smaller
_FARTHEST_IMPACTS_M: Final = 40.0
_APPROACH_MARGIN_M: Final = 20.0
_LEAST_APPROACH_HALF_WINDOW_M: Final = 45.0


def draw_crash(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate | None = None,
    log: SimulationLog | None = None,
    verdict: Verdict | None = None,
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> str:
    """Return the picture as an SVG.

    ``log`` is of the hypothesis that ``verdict`` names (else of the estimate's best). ``surroundings`` are drawn behind
    the roads.
    """
    hypothesis = _shown_hypothesis(estimate, verdict)
    sheet = Sheet()
    approach = _approach_window(hypothesis, log)
    impact = _impact_window(hypothesis, log)
    drawing = MapDrawing(
        network, around(approach, impact), surroundings=surroundings, dark=is_dark(record), fading=True
    )
    motion = DrawnMotion(hypothesis, log)
    sheet.headline(0, place_line(record))
    sheet.headline(1, outcome_line(verdict))
    for column, title, window in ((0, "Approach", approach), (1, "Impact", impact)):
        panel = sheet.panel(column, title, window)
        drawing.draw(panel)
        motion.draw(panel)
        draw_reported_point(panel, report)
    sheet.legend(vehicle_entries(record, hypothesis), sign_entries(report, hypothesis, log))
    return sheet.svg()


# --- what is shown ---------------------------------------------------------------------------------------------
def _shown_hypothesis(estimate: StateEstimate | None, verdict: Verdict | None) -> Hypothesis | None:
    if estimate is None:
        return None
    return estimate.hypotheses[verdict.hypothesis] if verdict else estimate.best


def _approach_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """Return a square around the reported point, all starts and all positions of rest."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    if hypothesis:
        points += [(p.initial_pose.x_m, p.initial_pose.y_m) for p in hypothesis.participants]
    if log:
        for vehicle in log.vehicles:
            points += [(float(vehicle.x_m[i]), float(vehicle.y_m[i])) for i in (0, -1)]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    half_m = float(np.max(high - low)) / 2 + _APPROACH_MARGIN_M
    x, y = ((low + high) / 2).tolist()
    return square((x, y), max(half_m, _LEAST_APPROACH_HALF_WINDOW_M))


def _impact_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """Return a square around the first contact; if several vehicles meet, around all planned contacts nearby."""
    contact = log.first_contact if log else None
    if log is None or contact is None:
        return square(hypothesis.impact_point_xy_m if hypothesis else (0.0, 0.0), _IMPACT_HALF_WINDOW_M)
    if log.is_figure(contact.number_2):
        return square((contact.x_m, contact.y_m), _STRIKE_HALF_WINDOW_M)
    events = hypothesis.planned if hypothesis and all(is_vehicle(e.party_2) for e in hypothesis.planned) else ()
    points = np.array([(contact.x_m, contact.y_m), *(event.xy_m for event in events[1:])])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = ((low + high) / 2).tolist()
    half_m = float(np.max(high - low)) / 2 + _IMPACT_HALF_WINDOW_M / 2
    if half_m > _FARTHEST_IMPACTS_M:
        return square((contact.x_m, contact.y_m), _IMPACT_HALF_WINDOW_M)
    return square((x, y), max(half_m, _IMPACT_HALF_WINDOW_M))


# --- crashes that are rejected for their map --------------------------------------------------------------------
_LEAST_HALF_WINDOW_M: Final = 60.0
_MARGIN: Final = 1.3
_STREETS: Final = 4  # no more streets are marked
_NAMED_COLOUR: Final = "#0B6E4F"
_OSM_COLOUR: Final = "#7A1FA2"


def draw_rejected_map(
    record: CrashRecord,
    network: RoadNetwork,
    extract: OsmExtract,
    report: RejectedMapReport,
    why: str,
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> str:
    """Return the picture as an SVG; its second line is ``why``, the reason of the rejection."""
    sheet = Sheet()
    sheet.headline(0, place_line(record))
    sheet.headline(1, why)
    pointed_at = _pointed_at(report)
    farthest_m = max((street.distance_m for street in pointed_at), default=0.0)
    wide = square((0.0, 0.0), max(_MARGIN * max(farthest_m, report.max_move_m), _LEAST_HALF_WINDOW_M))
    close = square((0.0, 0.0), _MARGIN * report.max_move_m)
    drawing = MapDrawing(network, around(wide, close), surroundings=surroundings, fading=True)
    lines = _osm_lines(network, extract)
    for column, title, window in ((0, "Streets around", wide), (1, "Reported point", close)):
        panel = sheet.panel(column, title, window)
        for street in pointed_at if column == 0 else ():
            x, y = street.nearest_xy_m
            sheet.write_at(panel, (x, y), f"{street.distance_m:.1f} m  {street.name or street.highway}")
        drawing.draw(panel)  # with the names of streets clear of what was written
        _draw_findings(panel, report, pointed_at, lines)
    sheet.legend(_KEY, _signs(report))
    return sheet.svg()


def _pointed_at(report: RejectedMapReport) -> list[NearStreet]:
    """Return the nearest street, then other named streets, those with a reported name first."""
    named = [street for street in report.streets[1:] if street.name]
    order = sorted(named, key=lambda street: (not street.bears_reported_name, street.distance_m))
    return [*report.streets[:1], *order][:_STREETS]


def _osm_lines(network: RoadNetwork, extract: OsmExtract) -> list[FloatArray]:
    lines = []
    for way in extract.ways:
        if is_drivable(way.tags, service_roads=True):
            nodes = [extract.nodes[number] for number in way.node_ids]
            latitudes, longitudes = (
                np.array([getattr(node, name) for node in nodes]) for name in ("latitude_deg", "longitude_deg")
            )
            lines.append(network.frame.to_local(latitudes, longitudes))
    return lines


def _draw_findings(
    panel: Canvas, report: RejectedMapReport, streets: list[NearStreet], osm_lines: list[FloatArray]
) -> None:
    panel.lines(osm_lines, _OSM_INK, 19)
    panel.discs([(0.0, 0.0)], report.max_move_m, _REACH_INK, 38)
    for street in streets:
        colour = _NAMED_COLOUR if street.bears_reported_name else CONTACT_COLOUR
        panel.lines([np.array([(0.0, 0.0), street.nearest_xy_m])], Ink(stroke=colour, width_pt=1.8), 39)
    draw_cross(panel)


_OSM_INK: Final = Ink(stroke=_OSM_COLOUR, width_pt=1.0, dash_pt=(1.0, 2.0))
_REACH_INK: Final = Ink(stroke=REPORTED_COLOUR, width_pt=1.0, dash_pt=(6.0, 4.0))
_KEY: Final = (
    Sign("to a street of a reported name", Ink(stroke=_NAMED_COLOUR, width_pt=2.0)),
    Sign("to a street of another name, or of none", Ink(stroke=CONTACT_COLOUR, width_pt=2.0)),
)


def _signs(report: RejectedMapReport) -> list[Sign]:
    return [
        Sign("reported point", Ink(stroke=REPORTED_COLOUR, width_pt=2.0), "cross"),
        Sign(f"{report.max_move_m:.0f} m, the farthest it is moved", _REACH_INK),
        Sign("OpenStreetMap's lines", _OSM_INK),
    ]


# --- headline and legend ----------------------------------------------------------------------------------------
_PATH_COLOUR: Final = "#555555"
_MOST_DESCRIBED: Final = 6  # parties; of more there is room for their kind alone


def place_line(record: CrashRecord) -> str:
    """Return the first line of a headline: the crash's key, kind and place.

    >>> place_line(record)[:40]
    '2023-319003   NE-411/MAIN ST / ELDER ST,'
    """
    roads = " / ".join(filter(None, (record.trafficway_1, record.trafficway_2)))
    place = ", ".join(filter(None, (roads, record.state_name)))
    described = "; ".join(filter(None, (", ".join(classes_in_words(record)), conditions_in_words(record))))
    return f"{record.key}   {place}   ({described})"


def outcome_line(verdict: Verdict | None) -> str:
    """Return the second line: the verdict; empty without one.

    >>> outcome_line(verdict)
    'verified, corroborated'
    """
    if verdict is None:
        return ""
    outcome = ", ".join(filter(None, (label_in_words(verdict), verdict.grade)))
    return f"{outcome}   {verdict.detail}".rstrip()


def vehicle_entries(record: CrashRecord, hypothesis: Hypothesis | None) -> list[Sign]:
    """Return the legend of each vehicle: colour, type, manoeuvre and speed.

    >>> [sign.label for sign in vehicle_entries(record, hypothesis)]
    ['V1 car, turn left, 14 mph as reported', 'V2 motorcycle, straight, 30 mph as reported']
    """
    reported = {vehicle.number: vehicle.travel_speed_mps for vehicle in record.vehicles}
    parked = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    planned = sorted(hypothesis.participants, key=lambda each: each.vehicle_number) if hypothesis else ()
    entries = []
    for index, each in enumerate(planned):
        source = "inferred" if reported.get(each.vehicle_number) is None else "as reported"
        speed_mps = each.impact_speed_mps if each.is_figure else each.initial_speed_mps  # people may wait at the edge
        speed = f"{mps_to_mph(speed_mps):.0f} mph {source}"
        what = each.kind if each.is_figure else each.vehicle_class
        words = [what.replace("_", " "), each.manoeuvre.replace("_", " "), speed]
        if each.vehicle_number in parked:
            words = [what.replace("_", " "), "parked or at work"]
        if len(planned) > _MOST_DESCRIBED:
            words = words[:1]
        label = f"{party_label(each.vehicle_number)} {', '.join(words)}"
        entries.append(Sign(label, Ink(stroke=vehicle_colour(index), width_pt=5.0)))
    return entries


def sign_entries(report: MapReport, hypothesis: Hypothesis | None, log: SimulationLog | None) -> list[Sign]:
    """Return the signs in this picture and their meaning.

    >>> [sign.label for sign in sign_entries(map_report, None, None)]
    ['reported point (× on the road)']
    """
    signs: list[Sign] = []
    if hypothesis:
        planned = Ink(stroke=_PATH_COLOUR, width_pt=1.0, dash_pt=(4.0, 3.0))
        signs.append(Sign("planned path, outline at its start", planned))
    if log:
        signs.append(Sign("driven path, pale body at rest", Ink(stroke=_PATH_COLOUR, width_pt=1.6)))
    if hypothesis and hypothesis.objects:
        ours = [item for item in hypothesis.objects if is_ours(item)]
        mapped = [item for item in hypothesis.objects if not is_ours(item)]
        said = [f"{names(mapped)}: OpenStreetMap's"] if mapped else []
        label = "; ".join([*said, *([f"{names(ours)}: placed by us"] if ours else [])])
        signs.append(Sign(label, Ink(stroke=OBJECT_COLOUR, width_pt=4.0)))
    if log and log.first_contact:
        several = len({(contact.number_1, contact.number_2) for contact in log.contacts}) > 1
        what = "first contact of each pair" if several else "first contact"
        signs.append(Sign(what, Ink(CONTACT_COLOUR), "star"))
    if log and any(overturned_at(vehicle) is not None for vehicle in log.vehicles):
        signs.append(Sign("overturned", Ink(CONTACT_COLOUR), "plus"))
    reported = Ink(stroke=REPORTED_COLOUR, width_pt=2.0)
    signs.append(Sign("reported point (× on the road)", reported, "cross"))
    if report.inferred_roads:
        signs.append(Sign("driveway: ours, not the map's", Ink(stroke=MINOR_SURFACE, width_pt=5.0)))
    return signs
