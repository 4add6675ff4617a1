"""What stands beside the picture of a crash: its headline, the parties, and the meaning of the signs."""

from __future__ import annotations

from typing import Final

from trace_dag.crash.conditions import conditions_in_words
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import classes_in_words
from trace_dag.roads.report import MapReport
from trace_dag.scenario.canvas import Ink
from trace_dag.scenario.colours import CONTACT_COLOUR, OBJECT_COLOUR, REPORTED_COLOUR, vehicle_colour
from trace_dag.scenario.map_surfaces import MINOR_SURFACE
from trace_dag.scenario.object_shapes import is_ours, names
from trace_dag.scenario.picture_sheet import Sign
from trace_dag.sim.types import SimulationLog, overturned_at
from trace_dag.states.types import Hypothesis
from trace_dag.units import mps_to_mph
from trace_dag.verdict.in_words import label_in_words
from trace_dag.verdict.types import Verdict

_PATH_COLOUR: Final = "#555555"
_MOST_DESCRIBED: Final = 6  # parties; of more there is room for their kind alone


def place_line(record: CrashRecord) -> str:
    """The first line of a headline: which crash it is, of what kind and where.

    >>> place_line(record)[:40]
    '2023-319003   NE-411/MAIN ST / ELDER ST,'
    """
    roads = " / ".join(filter(None, (record.trafficway_1, record.trafficway_2)))
    place = ", ".join(filter(None, (roads, record.state_name)))
    described = "; ".join(filter(None, (", ".join(classes_in_words(record)), conditions_in_words(record))))
    return f"{record.key}   {place}   ({described})"


def outcome_line(verdict: Verdict | None) -> str:
    """The second line: the verdict; empty without one.

    >>> outcome_line(verdict)
    'verified, corroborated'
    """
    if verdict is None:
        return ""
    outcome = ", ".join(filter(None, (label_in_words(verdict), verdict.grade)))
    return f"{outcome}   {verdict.detail}".rstrip()


def vehicle_entries(record: CrashRecord, hypothesis: Hypothesis | None) -> list[Sign]:
    """How each vehicle is drawn, its type, manoeuvre and speed.

    >>> [sign.label for sign in vehicle_entries(record, hypothesis)]
    ['V1 car, turn left, 14 mph as reported', 'V2 motorcycle, straight, 30 mph as reported']
    """
    reported = {vehicle.number: vehicle.travel_speed_mps for vehicle in record.vehicles}
    parked = {vehicle.number for vehicle in record.vehicles if not vehicle.in_transport}
    planned = sorted(hypothesis.participants, key=lambda each: each.vehicle_number) if hypothesis else ()
    entries = []
    for index, each in enumerate(planned):
        source = "inferred" if reported.get(each.vehicle_number) is None else "as reported"
        speed = f"{mps_to_mph(each.initial_speed_mps):.0f} mph {source}"
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
    """The signs in this picture and their meaning.

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
