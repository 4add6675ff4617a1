"""The content of a replay: positions over time, texts about the crash, the map, and all of it in three dimensions.

Belongs here: the content. Does not belong here: the pages that show it (:mod:`trace_dag.pages.replay`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import classes_in_words, conditions_in_words, event_named, is_dark
from trace_dag.pages.canvas import Canvas
from trace_dag.pages.drive import AgentDrive
from trace_dag.pages.map_scene import Window
from trace_dag.pages.maps import MapDrawing
from trace_dag.pages.page_templates import compress, vehicle_name
from trace_dag.pages.solid.scene import crash_glb
from trace_dag.reconstruction.samples.crash import PLACE_M, STEP_S, TURN_RAD
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drawn_shapes import (
    CONTACT_COLOUR,
    OBJECT_COLOUR,
    WHEEL_M,
    body_colour,
    describe_object,
    is_ours,
    logged_shape,
    outline,
    vehicle_colour,
)
from trace_dag.scenario.lights import Lights, crash_lights, lights_in_words, lit_lines
from trace_dag.scenario.traffic.surrounding import SurroundingTraffic, take_traffic
from trace_dag.simulation.types import Body, Moment, SimulationLog, VehicleLog, moment_of, overturned_at
from trace_dag.verdict.in_words import label_in_words
from trace_dag.verdict.types import EventResult, Verdict

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmFeature
    from trace_dag.reconstruction.samples.simulated import SampledRuns
    from trace_dag.simulation.types import Contact

_MARGIN_M = 25.0
_LEAST_SPAN_M = 90.0
_MAP_WIDTH_PT = 1296.0
_MAP_WIDER = 1.8  # than the overview is square: screens are wide
_CLOSE_UP_M, _CLOSE_UP_ON_A_PERSON_M = 32.0, 16.0


@dataclass(frozen=True)
class ReplayWindows:
    """Windows of a replay: the whole motion, and the impact close up."""

    overview: Window
    impact: Window


def replay_windows(log: SimulationLog, *, from_s: float = 0.0) -> ReplayWindows:
    """Return the square windows (m, local frame).

    They are around the motion from a time on, and around the first contact (or the middle of the motion).
    """
    points = np.concatenate([np.stack([v.x_m, v.y_m], axis=-1)[v.time_s >= from_s] for v in log.vehicles])
    low, high = points.min(axis=0), points.max(axis=0)
    half_m = max(float((high - low).max()) / 2 + _MARGIN_M, _LEAST_SPAN_M / 2)
    centre = (low + high) / 2
    contact = log.first_contact
    moment = moment_of(log)
    impact = np.array([moment.x_m, moment.y_m]) if moment else centre
    person = contact is not None and log.is_figure(contact.number_2)
    close_up_m = _CLOSE_UP_ON_A_PERSON_M if person else _CLOSE_UP_M
    return ReplayWindows(square(centre, half_m), square(impact, close_up_m / 2))


def square(centre: FloatArray, half_m: float) -> Window:
    """Return a window around a point, shape (2,), m.

    >>> square(np.array([10.0, 0.0]), 5.0)
    (5.0, -5.0, 15.0, 5.0)
    """
    x, y = float(centre[0]), float(centre[1])
    return x - half_m, y - half_m, x + half_m, y + half_m


@dataclass(frozen=True, eq=False)
class ReplayContent:
    """``said`` is for JSON, ``map_svg`` is the map in the background, ``solid`` a GLB, or None for a plan view only."""

    said: Mapping[str, Any]
    map_svg: str
    solid: bytes | None = None

    @cached_property
    def zipped_map(self) -> bytes:
        """Return the map as pages hold it, before it is written in base64."""
        return compress(self.map_svg.encode())


def replay_content(
    record: CrashRecord,
    network: RoadNetwork,
    log: SimulationLog,
    verdict: Verdict | None = None,
    drive: AgentDrive | None = None,
    *,
    surroundings: Sequence[OsmFeature] = (),
    sampled: SampledRuns | None = None,
    traffic: SurroundingTraffic | None = None,
    beside: ReplayWindows | None = None,
    in_3d: bool = True,
) -> ReplayContent:
    """Return the content for a log: of the hypothesis that ``verdict`` judges, or of an agent's ``drive``.

    ``sampled`` has other likely courses, which can be chosen, ``traffic`` vehicles around the crash. A drive shown
    ``beside`` others has their windows, and its outcome as its title.

    >>> content = replay_content(record, network, log, verdict, in_3d=False)
    >>> content.solid is None, content.map_svg[:4]
    (True, '<svg')
    """
    log, among = take_traffic(log)
    traffic = among or traffic
    windows = beside or choose_windows(log, drive)
    west, south, east, north = windows.overview
    wider = (east - west) * (_MAP_WIDER - 1) / 2
    map_window = (west - wider, south, east + wider, north)
    outcome = drive.title if drive else _outcome(verdict)
    subtitles = (place_in_words(record), " · ".join(classes_in_words(record)), conditions_in_words(record), outcome)
    said = {
        **_data(record, network, log, windows),
        **_ghost(drive, log),
        "courses": [] if sampled is None or drive is not None else _courses(sampled),
        "events": [] if verdict is None or drive is not None else _events(verdict),
        "sight": []
        if verdict is None or drive is not None
        else [{"parties": [each.driver, each.other], "hidden": each.hidden_s} for each in verdict.sight_lines],
        **_lights(network, crash_lights(record, network, log if drive is None else drive.recorded)),
        "traffic": [] if traffic is None else list(_traffic(traffic, map_window)),
        "map": [round(value, 2) for value in map_window],
        "key": record.key,
        "night": is_dark(record),
        "title": outcome if beside else f"Crash {record.key}",
        "subtitles": [] if beside else [text for text in subtitles if text],
    }
    return ReplayContent(
        said,
        _map_svg(network, map_window, surroundings, dark=is_dark(record)),
        crash_glb(record.key, network, log, drive, surroundings=surroundings) if in_3d else None,
    )


def choose_windows(log: SimulationLog, drive: AgentDrive | None) -> ReplayWindows:
    """Return the windows; for an agent's drive, those around the conflict that it had to avoid."""
    windows = replay_windows(log)
    return windows if drive is None else replace(windows, impact=replay_windows(drive.recorded).impact)


def place_in_words(record: CrashRecord) -> str:
    """Return the streets, the county and the state of a crash.

    >>> place_in_words(record)
    'NE-411/MAIN ST / ELDER ST, Lodestar, Nebraska'
    """
    roads = " / ".join(filter(None, (record.trafficway_1, record.trafficway_2)))
    return ", ".join(filter(None, (roads, record.county_name.title(), record.state_name)))


def _events(verdict: Verdict) -> list[dict[str, object]]:
    """Return a time-line mark for each reported harmful event, with its time, if it happens, and a text."""
    marks: list[dict[str, object]] = []
    for each in verdict.events:
        what = event_named(each.event_number, each.code)
        if each.outcome is EventResult.HAPPENED and each.time_s is None:
            continue  # it goes on with the one before it
        how = "" if each.time_s is not None else ": does not happen" + (f" ({each.why})" if each.why else "")
        marks.append({"number": each.event_number, "time": each.time_s, "words": f"{what}{how}"})
    return marks


def _outcome(verdict: Verdict | None) -> str:
    return "not judged" if verdict is None else label_in_words(verdict)


def _map_svg(network: RoadNetwork, window: Window, surroundings: Sequence[OsmFeature], *, dark: bool) -> str:
    canvas = Canvas(window, _MAP_WIDTH_PT)
    MapDrawing(network, window, surroundings=surroundings, dark=dark, fading=True).draw(canvas)
    return canvas.svg()


def _data(record: CrashRecord, network: RoadNetwork, log: SimulationLog, windows: ReplayWindows) -> dict[str, Any]:
    contact = log.first_contact
    reported = {vehicle.number: vehicle for vehicle in record.vehicles}
    vehicles = []
    for vehicle in log.vehicles:
        body, said = log.bodies[vehicle.number], reported.get(vehicle.number)
        vehicles.append(
            {
                "number": vehicle.number,
                "name": party_label(vehicle.number),
                "kind": str(body.kind),
                "label": ("" if body.is_figure else body.vehicle_class).replace("_", " "),
                "make": vehicle_name(said.make_model) if said else "",
                "colour": body_colour(vehicle.number, log.bodies),
                "length": round(body.length_m, 2),
                "width": round(body.width_m, 2),
                "height": round(body.height_m, 2),
                "reported": None if said is None or said.travel_speed_mps is None else round(said.travel_speed_mps, 2),
                "delta_v": _delta_v(log, vehicle.number),
                **_motion(vehicle),
                **(_figure(vehicle, body) if body.is_figure else {}),
            }
        )
    return {
        "time": [round(float(t), 3) for t in log.vehicles[0].time_s],
        "vehicles": vehicles,
        "contact": None if contact is None else {**_place_of(contact), "closing": round(contact.closing_speed_mps, 2)},
        "later": [{"numbers": [each.number_1, each.number_2], **_place_of(each)} for each in log.first_of_each[1:]],
        "overturns": [_overturn(each, k) for each in log.vehicles if (k := overturned_at(each)) is not None],
        "objects": [
            {"name": describe_object(item), "corners": np.round(outline(item), 2).tolist(), "ours": is_ours(item)}
            for item in log.objects
        ],
        "object_colour": OBJECT_COLOUR,
        "contact_colour": CONTACT_COLOUR,
        "attribution": network.attribution,
        "moment": None if (moment := moment_of(log)) is None else {"numbers": moment.numbers, **_place_of(moment)},
        "termination": log.termination.replace("_", " "),
        "overview": [round(value, 2) for value in windows.overview],
        "impact": [round(value, 2) for value in windows.impact],
    }


def _ghost(drive: AgentDrive | None, log: SimulationLog) -> dict[str, Any]:
    """Return the recorded vehicle, in the place of which an agent drove."""
    if drive is None:
        return {"ghost": None}
    poses = drive.ghost(log.vehicles[0].time_s)
    index = next(k for k, each in enumerate(log.vehicles) if each.number == drive.number)
    return {
        "ghost": {
            "agent": drive.agent,
            "number": drive.number,
            "colour": vehicle_colour(index),
            "length": round(drive.body.length_m, 2),
            "width": round(drive.body.width_m, 2),
            **{name: np.round(poses[:, k], 3).tolist() for k, name in enumerate("xyh")},
        }
    }


def _courses(sampled: SampledRuns) -> list[dict[str, Any]]:
    """Return other likely courses.

    Places in the steps of :class:`trace_dag.reconstruction.samples.crash.SampledBody`.
    """
    courses: list[dict[str, Any]] = []
    for course in sampled.courses:
        contact = sampled.contact_of(course)
        speeds = (f"{party_label(each.number)} {mps_to_mph(each.impact_speed_mps):.0f} mph" for each in contact.parties)
        courses.append(
            {
                "name": f"likely course {len(courses) + 1} ({contact.weight:.0%}): {', '.join(speeds)}",
                "begins": course.begins_s,
                "step": STEP_S,
                "units": {"x": PLACE_M, "y": PLACE_M, "h": TURN_RAD},
                "contact": {"x": contact.x_m, "y": contact.y_m},
                "parties": {
                    each.number: {"impact": each.impact_speed_mps, "delta_v": each.delta_v_mps}
                    for each in contact.parties
                },
                "bodies": [
                    {"number": body.number, "x": body.x, "y": body.y, "h": body.heading} for body in course.bodies
                ],
            }
        )
    return courses


def _lights(network: RoadNetwork, readings: Sequence[Lights]) -> dict[str, Any]:
    """Return the stop lines of lights with their programs by the first reading, and all readings in words."""
    lines = lit_lines(network, next(iter(readings), None))
    return {
        "lights": [{"ends": line.ends_m, "steps": cycle.steps} for line, cycle in lines],
        "lights_said": lights_in_words(readings),
    }


def _traffic(traffic: SurroundingTraffic, window: Window) -> Iterator[dict[str, Any]]:
    """Yield the vehicles that enter the window, from their first time there, in steps of simulated time."""
    west, south, east, north = window
    for each in traffic.vehicles:
        t = each.trajectory
        if ((t.x_m > west) & (t.x_m < east) & (t.y_m > south) & (t.y_m < north)).any():
            yield {
                "length": each.body.length_m,
                "width": each.body.width_m,
                "time": t.time_s.tolist(),
                "x": np.round(t.x_m, 2).tolist(),
                "y": np.round(t.y_m, 2).tolist(),
                "h": np.round(np.unwrap(t.heading_rad), 3).tolist(),
            }


def _overturn(vehicle: VehicleLog, k: int) -> dict[str, Any]:
    """Return time and place of a vehicle's overturn."""
    time_s, x, y = (float(values[k]) for values in (vehicle.time_s, vehicle.x_m, vehicle.y_m))
    return {**_place_of(Moment(time_s, x, y, (vehicle.number,))), "name": party_label(vehicle.number)}


def _place_of(moment: Moment | Contact) -> dict[str, float]:
    return {"time": round(moment.time_s, 4), "x": round(moment.x_m, 3), "y": round(moment.y_m, 3)}


def _motion(vehicle: VehicleLog) -> dict[str, list[float]]:
    heading = np.unwrap(vehicle.heading_rad)
    speed = np.hypot(vehicle.velocity_x_mps, vehicle.velocity_y_mps)
    columns = {"x": (vehicle.x_m, 3), "y": (vehicle.y_m, 3), "h": (heading, 4), "v": (speed, 2)}
    if np.abs(vehicle.roll_rad).max(initial=0.0) > 0.01 and not vehicle.landmarks_m.shape[1]:
        columns |= {"roll": (vehicle.roll_rad, 3)}
    columns |= {"brake": (vehicle.brake, 2), "throttle": (vehicle.throttle, 2), "steer": (vehicle.steer_rad, 3)}
    return {name: np.round(values, digits).tolist() for name, (values, digits) in columns.items()}


def _figure(person: VehicleLog, body: Body) -> dict[str, Any]:
    """Return the height of a person's body above the road (m), and the figure from above at each time.

    The figure has lines x, y, x, y with their widths, a flag for lines of the body, as opposed to the mount, and the
    head.
    """
    shapes = [logged_shape(person, k, body) for k in range(len(person.time_s))]
    widths = [*([WHEEL_M] * len(shapes[0].ridden)), *(round(width_m, 3) for _, width_m in shapes[0].lines)]
    ends = np.array([[*shape.ridden, *(line for line, _ in shape.lines)] for shape in shapes])
    return {
        "up": np.round(person.above_road_m, 2).tolist(),
        "widths": widths,
        "ridden": len(shapes[0].ridden),
        "lines": np.round(ends.reshape(len(shapes), -1), 2).tolist(),
        "head": np.round([shape.head for shape in shapes], 2).tolist(),
        "head_radius": round(shapes[0].head_m, 3),
    }


def _delta_v(log: SimulationLog, number: int) -> dict[str, float] | None:
    """Return a party's change of velocity in its first contact, with the time."""
    for contact in filter(None, (log.first_contact, *log.first_of_each)):
        if number in (contact.number_1, contact.number_2):
            x, y = contact.delta_v_1_mps if number == contact.number_1 else contact.delta_v_2_mps
            return {"time": round(contact.time_s, 4), "mps": round(float(np.hypot(x, y)), 2)}
    return None
