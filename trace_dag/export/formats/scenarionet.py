"""Scenario descriptions of ScenarioNet, which MetaDrive replays and drives in: a pickled dictionary per crash.

The track that a driver under test takes over (``sdc_id``) is the striking vehicle's, or the first one's. All tracks are
the courses without the crash, every :data:`trace_dag.scenario.drives.STEP_S`; otherwise, after a driver avoids the
crash, the others would still move as if thrown by it. Frame: the crash's local frame.

A road map without a crash is a scenario too: a car drives along its lanes at the limit, and may be taken over.

Format: Li et al., ScenarioNet: Open-source platform for large-scale traffic scenario simulation and modeling, NeurIPS
2023, and MetaDrive 0.4's ``ScenarioDescription``.
"""

from __future__ import annotations

import copyreg
import io
import pickle
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from trace_dag.agents.stored_cases import AgentRole, case_of, number_of
from trace_dag.agents.stored_traffic import traffic_of
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mps_to_kmh
from trace_dag.crash.parties import party_label, party_of_body
from trace_dag.crash.record import VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.formats.lane_rules import LaneRules
from trace_dag.flow.contract import CrashFiles
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.model import LaneRef, RoadMark
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.paths import trace_forward
from trace_dag.scenario.cases import Case
from trace_dag.scenario.drives import STEP_S, Drive, drives_of
from trace_dag.scenario.driving_files import lane_id
from trace_dag.scenario.lights import Lights
from trace_dag.simulation.types import BodyKind
from trace_dag.version import __version__

_DATASET: Final = "trace-dag"
_VERSION: Final = "MetaDrive v0.4.3"
_PICKLE_PROTOCOL: Final = 4  # the oldest that all Pythons of today write and read
_TYPES: Final = {
    BodyKind.MOTOR_VEHICLE: "VEHICLE",
    BodyKind.PEDESTRIAN: "PEDESTRIAN",
    BodyKind.CYCLIST: "CYCLIST",
    BodyKind.CONVEYANCE: "PEDESTRIAN",
    BodyKind.ANIMAL: "PEDESTRIAN",  # the format has no animals
}
_MOVES_M: Final = 1.0  # what MetaDrive counts as moving
_NEAR_M: Final = 100.0  # of the middle of a map: where a car may begin its drive
_STARTS: Final = 20  # lanes that are tried
_WAY_M: Final = 300.0
_CAR_M: Final = (4.8, 1.8, 1.45)


class ScenarioNet(Exporter):
    """``sd_trace-dag_<version>_<key>.pkl`` for each crash, and the two files that make a folder a data set."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._summaries: dict[str, dict[str, Any]] = {}

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        case = case_of(crash, crash.settings.sim)
        drives = drives_of(case)
        if not any(each.is_driven for each in drives):
            raise UserError("nobody drives in it")
        ego = _ego(case, drives)
        shown = [each for each in drives if each.number == ego or party_of_body(each.number) != ego]
        tracks = {party_label(each.number): _track(each) for each in shown}  # without the trailer that the ego pulls
        length, traffic = len(drives[0].course), traffic_of(crash)
        for each in () if traffic is None else traffic.vehicles:
            begins, course = each.course
            if begins < length:
                name, size_m = party_label(each.number), (each.body.length_m, each.body.width_m, each.body.height_m)
                padded = np.pad(
                    course[: length - begins], ((begins, max(length - begins - len(course), 0)), (0, 0)), "edge"
                )
                tracks[name] = _track_of(name, "VEHICLE", padded, size_m, each.body.vehicle_class)
                tracks[name]["state"]["valid"] &= (np.arange(length) >= begins) & (
                    np.arange(length) < begins + len(course)
                )
        source = f"crash {crash.key}"
        name, scenario = _scenario(crash.key, source, case.network, tracks, party_label(ego), case.lights)
        self._summaries[name] = scenario["metadata"]
        return {name: _pickled(scenario)}

    def beside(self) -> Mapping[str, bytes]:
        """Return the metadata of the folder: those of each file, and the mapping of files to the folder."""
        return _about(self._summaries)


def road_description(network: RoadNetwork) -> dict[str, bytes]:
    """Return a road map as a data set of one scenario.

    A car drives from near the middle along the lanes, at their limits.

    Raises :class:`UserError` if the map has no lane long enough to drive in.
    """
    name, scenario = _scenario("map", "road map", network, {"car": _car(network)}, "car")
    return {name: _pickled(scenario), **_about({name: scenario["metadata"]})}


def _scenario(
    key: str, source: str, network: RoadNetwork, tracks: Mapping[str, Any], ego: str, lights: Lights | None = None
) -> tuple[str, dict[str, Any]]:
    """Return the name of a scenario's file, and the scenario."""
    length = len(tracks[ego]["state"]["valid"])
    metadata = {
        "dataset": _DATASET,
        "scenario_id": key,
        "coordinate": "metadrive",
        "metadrive_processed": False,
        "ts": (np.arange(length) * STEP_S).astype(np.float32),
        "sdc_id": ego,
        "object_summary": {name: _summary(name, track) for name, track in tracks.items()},
        "source_file": f"trace-dag {__version__}, {source}",
        "map_attribution": network.attribution,
    }
    scenario = {
        "id": key,
        "version": _VERSION,
        "length": length,
        "metadata": metadata,
        "tracks": dict(tracks),
        "dynamic_map_states": {} if lights is None else _light_states(network, lights, length),
        "map_features": _map_features(network),
    }
    metadata["number_summary"] = _numbers(scenario)
    return f"sd_{_DATASET}_{__version__}_{key}.pkl", scenario


def _light_states(network: RoadNetwork, lights: Lights, length: int) -> dict[str, Any]:
    """Return the colour at each step for the lanes under each light, by lane."""
    rules, cycle_of = LaneRules(network), lights.cycle_of
    found = {}
    for post in rules.lights:
        if post.signal.id in cycle_of:
            colours = [f"TRAFFIC_LIGHT_{cycle_of[post.signal.id].at(k * STEP_S).upper()}" for k in range(length)]
            for ref in post.lanes:
                name, kind = lane_id(ref), "TRAFFIC_LIGHT"
                found[name] = {
                    "type": kind,
                    "lane": name,
                    "stop_point": rules.stop_line(ref, post.signal.s_m).mean(axis=0),
                    "state": {"object_state": colours},
                    "metadata": {"type": kind, "object_id": name, "track_length": length},
                }
    return found


def _about(summaries: Mapping[str, dict[str, Any]]) -> dict[str, bytes]:
    """Return the two files that make a folder a data set."""
    ordered = dict(sorted(summaries.items()))
    return {"dataset_summary.pkl": _pickled(ordered), "dataset_mapping.pkl": _pickled(dict.fromkeys(ordered, ""))}


def _pickled(content: object) -> bytes:
    """Return a pickle whose arrays are named by what NumPy 1 and 2 share.

    NumPy 2 writes the name of a private module, which versions before 1.26 do not have. Those are in use beside
    MetaDrive, because kits of driving data sets require them.

    >>> b"_core" in _pickled(np.zeros(3)), pickle.loads(_pickled(np.arange(3.0)))
    (False, array([0., 1., 2.]))
    """
    stream = io.BytesIO()
    pickler = pickle.Pickler(stream, _PICKLE_PROTOCOL)
    pickler.dispatch_table = copyreg.dispatch_table | {np.ndarray: _array_parts}
    pickler.dump(content)
    return stream.getvalue()


def _array_parts(array: FloatArray) -> tuple[type, tuple[Any, ...]]:
    """Return a call that makes the same array, of bytes that may be changed."""
    return np.ndarray, (array.shape, array.dtype.str, bytearray(array.tobytes()))


def _ego(case: Case, drives: Sequence[Drive]) -> int:
    """Return the striking driver; for a strike of an object or an overturn, the first driver."""
    contact = case.contact
    if contact is not None and {contact.number_1, contact.number_2} <= {each.number for each in drives}:
        return number_of(case, AgentRole.STRIKING)
    return min(each.number for each in drives if each.is_driven)


def _car(network: RoadNetwork) -> dict[str, Any]:
    """Return a car on the longest path from the lanes near the middle (x and y of the frame are 0 there)."""
    near = [match.lane for match in network.nearest_lanes(0.0, 0.0, _NEAR_M)]
    starts = [each for each in near or network.drivable_lanes() if network.road_by_id[each.road_id].junction_id is None]
    ways = [
        trace_forward(network, each, begin_m, _WAY_M, max_paths=1)[0]
        for each in starts[:_STARTS]
        for geometry in [network.geometry(each)]
        for begin_m in [geometry.begin_m if geometry.direction > 0 else geometry.end_m]
    ]
    if not ways:
        raise UserError("the map has no lane to drive in")
    way = max(ways, key=lambda each: round(each.length_m))
    lane = network.lane(way.lanes[0])
    road = network.road_by_id[way.lanes[0].road_id]
    speed_mps = lane.speed_mps or road.speed_mps or road_class(road.highway).speed_mps
    stations = np.arange(0.0, way.length_m, speed_mps * STEP_S)
    states = [np.interp(stations, way.stations_m, column) for column in way.points.T]
    course = np.column_stack([*states, np.full(len(stations), speed_mps)])
    return _track_of("car", "VEHICLE", course, _CAR_M, VehicleClass.CAR)


def _track(drive: Drive) -> dict[str, Any]:
    body = drive.participant.body
    size_m = (body.length_m, body.width_m, body.height_m)
    return _track_of(party_label(drive.number), _TYPES[body.kind], drive.course, size_m, body.vehicle_class)


def _track_of(
    name: str, kind: str, course: FloatArray, size_m: tuple[float, float, float], vehicle_class: VehicleClass
) -> dict[str, Any]:
    """Return ``course``: x, y, z, heading, speed every step, shape (n, 5); ``size_m``: length, width, height."""
    heading, speed, length = course[:, 3], course[:, 4], len(course)

    def always(value: float) -> FloatArray:
        return np.full(length, value)

    length_m, width_m, height_m = size_m
    return {
        "type": kind,
        "state": {
            "position": course[:, :3],
            "heading": heading,
            "velocity": np.column_stack([speed * np.cos(heading), speed * np.sin(heading)]),
            "length": always(length_m),
            "width": always(width_m),
            "height": always(height_m),
            "valid": np.ones(length, bool),
        },
        "metadata": {"type": kind, "object_id": name, "track_length": length, "vehicle_class": str(vehicle_class)},
    }


def _summary(name: str, track: Mapping[str, Any]) -> dict[str, Any]:
    steps_m = np.hypot(*np.diff(track["state"]["position"][:, :2], axis=0).T)
    valid = int(track["state"]["valid"].sum())
    return {
        "type": track["type"],
        "object_id": name,
        "track_length": len(track["state"]["valid"]),
        "moving_distance": float(steps_m.sum()),
        "valid_length": valid,
        "continuous_valid_length": valid,
    }


def _numbers(scenario: Mapping[str, Any]) -> dict[str, Any]:
    """Return the counts by which ScenarioNet filters."""
    objects = scenario["metadata"]["object_summary"].values()
    moving = [each for each in objects if each["moving_distance"] > _MOVES_M]
    heights = np.concatenate([np.asarray(each["polyline"])[:, 2] for each in scenario["map_features"].values()])
    colours = [c for each in scenario["dynamic_map_states"].values() for c in each["state"]["object_state"]]
    return {
        "num_objects": len(objects),
        "object_types": {each["type"] for each in objects},
        "num_objects_each_type": dict(Counter(each["type"] for each in objects)),
        "num_moving_objects": len(moving),
        "num_moving_objects_each_type": dict(Counter(each["type"] for each in moving)),
        "num_traffic_lights": len(scenario["dynamic_map_states"]),
        "num_traffic_light_types": set(colours),
        "num_traffic_light_each_step": dict(Counter(colours)),
        "num_map_features": len(scenario["map_features"]),
        "map_height_diff": float(np.ptp(heights)),
    }


# --- map ---------------------------------------------------------------------------------------------------------
def _map_features(network: RoadNetwork) -> dict[str, dict[str, Any]]:
    shapes = [shape for shape in lane_shapes(network, drivable_only=True) if shape.length_m > 0.0]
    known = {shape.ref for shape in shapes}
    features = {lane_id(shape.ref): _lane(shape, known) for shape in shapes}
    for shape in shapes:
        features |= _lines(network, shape)
    return features


def _lane(shape: LaneShape, known: set[LaneRef]) -> dict[str, Any]:
    def ids(refs: Iterable[LaneRef | None]) -> list[str]:
        return [lane_id(ref) for ref in refs if ref is not None and ref in known]

    return {
        "type": "LANE_SURFACE_STREET" if shape.junction_id is None else "LANE_SURFACE_UNSTRUCTURE",
        "polyline": shape.centre_m,
        "polygon": np.concatenate([shape.left_m, shape.right_m[::-1]])[:, :2],
        "entry_lanes": ids(shape.predecessors),
        "exit_lanes": ids(shape.successors),
        "left_neighbor": ids([shape.left]) if shape.left_same_way else [],
        "right_neighbor": ids([shape.right]) if shape.right_same_way else [],
        **({} if shape.speed_mps is None else {"speed_limit_kmh": mps_to_kmh(shape.speed_mps)}),
    }


def _lines(network: RoadNetwork, shape: LaneShape) -> dict[str, dict[str, Any]]:
    """Return the marked lines on the borders of a lane and the edges of the carriageway; none within junctions."""
    if shape.junction_id is not None:
        return {}
    section = network.road_by_id[shape.ref.road_id].lane_sections[shape.ref.section]
    marks = {lane.id: lane.legal_mark or lane.mark for lane in section.lanes}
    lines = {}
    edge = shape.right is None
    kind = "ROAD_EDGE_BOUNDARY" if edge else _line_type(marks[shape.ref.lane_id])
    if kind:
        lines[f"{lane_id(shape.ref)}.right"] = {"type": kind, "polyline": shape.right_m}
    if shape.left is None:
        lines[f"{lane_id(shape.ref)}.left"] = {"type": "ROAD_EDGE_BOUNDARY", "polyline": shape.left_m}
    elif shape.ref.lane_id == -1 and (kind := _line_type(marks.get(0))):  # the centre line, once
        lines[f"{lane_id(shape.ref)}.left"] = {"type": kind, "polyline": shape.left_m}
    return lines


def _line_type(mark: RoadMark | None) -> str:
    if mark is None or mark.type == "none":
        return ""
    colour = "YELLOW" if mark.colour == "yellow" else "WHITE"
    if mark.type == "solid solid":
        return f"ROAD_LINE_SOLID_DOUBLE_{colour}"
    if "broken" in mark.type and "solid" in mark.type:
        return "ROAD_LINE_PASSING_DOUBLE_YELLOW"
    return f"ROAD_LINE_{'SOLID' if mark.type == 'solid' else 'BROKEN'}_SINGLE_{colour}"
