"""Messages from a prompt file and a crash, with the numbered approaches from which a model chooses.

Text from reports and maps goes into the prompt as JSON with its angle brackets escaped, inside a fence that the system
message declares to be data. So no text of a report can close the fence or look like a message.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from operator import itemgetter
from string import Template

from trace_dag.common.errors import UserError
from trace_dag.crash.record import CrashRecord, ImpactArea, VehicleRecord
from trace_dag.language.answer import Kind, form
from trace_dag.reconstruction.candidates import Candidate
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene

_SAMPLED_AT_M = (0.0, 10.0, 25.0, 50.0, 75.0, 100.0, 150.0)
_WITHIN_LANE_M = 3.0
_CENTIMETRES = 2  # digits


@dataclass(frozen=True, eq=False)
class OfferedApproach:
    """One candidate approach: an approach under a short id, and the vehicles it is open to."""

    id: str
    approach: Approach
    vehicles: tuple[int, ...]

    @property
    def length_m(self) -> float:
        """Return the length (m) of the approach that the map contains upstream of the crash."""
        begin = self.approach.mapped_from_m
        return self.approach.station_m - begin

    def heading_deg(self, before_m: float) -> float:
        """Return the direction of travel ``before_m`` before the crash, degrees CCW from east, 0 to 360."""
        pose = self.approach.path.pose(self.approach.station_m - before_m)
        return math.degrees(pose.heading_rad) % 360.0

    def described(self) -> dict[str, object]:
        """Return the description of the approach for the model."""
        approach, road = self.approach, self.approach.road
        movement = f"turns {approach.turn.value} here" if approach.turn is not None else "passes the crash"
        if approach.turn is not None and approach.exit_road is not None and approach.exit_road.name:
            movement += f" into {approach.exit_road.name}"
        if approach.wrong_way:
            movement += ", against the traffic of this lane"
        if approach.goes_either_way:
            movement += ", on a reversible road that may have gone either way at the hour"
        here = approach.lanes[0] if approach.lanes else None
        points = []
        for before_m in _SAMPLED_AT_M:
            if before_m <= self.length_m:
                pose = approach.path.pose(approach.station_m - before_m)
                points.append([before_m, round(pose.x_m, 1), round(pose.y_m, 1), round(self.heading_deg(before_m))])
        return {
            "id": self.id,
            "open_to_vehicles": list(self.vehicles),
            "street": list(road.names) if road is not None else ["not on the map"],
            "road": road.id if road is not None else None,
            "lane": here.lane_id if here is not None else None,
            "lane_counted_from_left": approach.lane_from_left + 1,
            "lanes_in_this_direction": approach.lanes_along,
            "lanes_in_all": approach.lanes_total,
            "one_way": approach.one_way,
            "shared_centre_lane": approach.centre_lane,
            "speed_limit_mps": round(road.speed_mps, 1) if road is not None and road.speed_mps else None,
            "movement": movement,
            "known_for_m": round(self.length_m),
            "points_before_crash_m_x_y_heading": points,
        }


@dataclass(frozen=True, eq=False)
class Choices:
    """All approaches of one crash."""

    scene: Scene
    found: tuple[Candidate, ...]

    @cached_property
    def offered(self) -> tuple[OfferedApproach, ...]:
        """Return every approach that some reading of the record gives to a vehicle, in order of first mention."""
        approaches: dict[str, Approach] = {}
        vehicles: dict[str, set[int]] = {}
        for candidate in self.found:
            for party, option in (
                (candidate.scenario.mover, candidate.mover),
                (candidate.scenario.other, candidate.other),
            ):
                approaches.setdefault(option.approach.name, option.approach)
                vehicles.setdefault(option.approach.name, set()).add(party.vehicle.number)
        return tuple(
            OfferedApproach(f"C{number}", approach, tuple(sorted(vehicles[name])))
            for number, (name, approach) in enumerate(approaches.items(), start=1)
        )

    def by_id(self, approach_id: str) -> OfferedApproach | None:
        """Return the approach with that id, or None."""
        return next((offered for offered in self.offered if offered.id == approach_id), None)

    def at(self, x_m: float, y_m: float, heading_deg: float, vehicle_number: int) -> list[OfferedApproach]:
        """Return a vehicle's approaches through a point in a direction, the nearest first.

        Several approaches share a lane until they part at the crash and are equally near there; these keep their order.
        """
        near: list[tuple[float, OfferedApproach]] = []
        for offered in self.offered:
            if vehicle_number not in offered.vehicles:
                continue
            station, offset = offered.approach.path.project(x_m, y_m)
            before_m = offered.approach.station_m - station
            apart = abs(math.remainder(offered.heading_deg(max(before_m, 0.0)) - heading_deg, 360.0))
            if abs(offset) <= _WITHIN_LANE_M and -5.0 <= before_m <= offered.length_m and apart <= 60.0:
                near.append((round(abs(offset), _CENTIMETRES), offered))
        return [offered for _, offered in sorted(near, key=itemgetter(0))]

    def chosen(self, by_vehicle: dict[int, OfferedApproach]) -> list[Candidate]:
        """Return the candidates in which every vehicle is on its chosen approach."""
        kept = []
        for candidate in self.found:
            pairs = (
                (candidate.scenario.mover, candidate.mover),
                (candidate.scenario.other, candidate.other),
            )
            if all(option.approach.name == by_vehicle[party.vehicle.number].approach.name for party, option in pairs):
                kept.append(candidate)
        return kept


_KINDS: dict[str, Kind] = {"segments": "segments", "coordinates": "coordinates"}
_LONGEST_TEXT = 2000
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")

Message = dict[str, str]


@dataclass(frozen=True)
class Prompt:
    """One version of the prompt: its name, kind, the two templates, and a digest of its text."""

    version: str
    kind: Kind
    system: Template
    user: Template
    digest: str

    @classmethod
    def load(cls, version: str) -> Prompt:
        """Return the prompt of that name.

        Raises :class:`UserError` that lists the known names if it is unknown.
        """
        folder = files("trace_dag.language") / "prompts"
        known = sorted(entry.name.removesuffix(".md") for entry in folder.iterdir() if entry.name.endswith(".md"))
        known = [name for name in known if name.rpartition("-v")[0] in _KINDS]
        if version not in known:
            raise UserError(f"no prompt is called {version!r}; set states.llm_prompt to one of {', '.join(known)}")
        text = (folder / f"{version}.md").read_text(encoding="utf-8")
        system, user = text.removeprefix("# system\n").split("\n# user\n")
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        return cls(version, _KINDS[version.rpartition("-v")[0]], Template(system), Template(user), digest)

    def messages(self, record: CrashRecord, choices: Choices, *, lead_time_s: float) -> list[Message]:
        """Return the first question about a crash."""
        schema = json.dumps(form(self.kind).model_json_schema(), sort_keys=True)
        data = fence(_data(record, choices))
        values = {"lead_time_s": f"{lead_time_s:g}", "schema": schema, "data": data}
        return [
            {"role": "system", "content": self.system.substitute(values).strip()},
            {"role": "user", "content": self.user.substitute(values).strip()},
        ]


def ask_again(messages: list[Message], answer: str, complaints: list[str]) -> list[Message]:
    """Return the conversation with a new question that lists the faults of the last answer.

    >>> [each["role"] for each in ask_again([], "{}", ["crash: Field required"])]
    ['assistant', 'user']
    """
    listed = "\n".join(f"- {fence(complaint)}" for complaint in complaints)
    return [
        *messages,
        {"role": "assistant", "content": answer or "(no answer)"},
        {
            "role": "user",
            "content": f"That answer cannot be used. What is wrong with it, as data:\n{listed}\n\n"
            "Answer again, with all of it put right, in the same form.",
        },
    ]


def fence(value: object, *, longest: int = _LONGEST_TEXT) -> str:
    """Return a value as JSON that cannot close a fence.

    Angle brackets escaped, control characters removed, texts cut that are longer than ``longest`` characters.

    >>> print(fence('MAIN ST </data>'))
    "MAIN ST \\u003c/data\\u003e"
    """
    text = json.dumps(_clean(value, longest), ensure_ascii=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e")


def _clean(value: object, longest: int) -> object:
    if isinstance(value, str):
        return _CONTROL.sub(" ", value)[:longest]
    if isinstance(value, dict):
        return {str(key): _clean(each, longest) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(each, longest) for each in value]
    return value


def _data(record: CrashRecord, choices: Choices) -> dict[str, object]:
    x_m, y_m = choices.scene.place_xy_m
    return {
        "report": {
            "summary": record.summary,
            "streets": [name for name in (record.trafficway_1, record.trafficway_2) if name],
            "manner_of_collision": record.collision_type.value,
            "road_topology": record.road_topology.value,
            "vehicle_trajectory": record.vehicle_trajectory.value,
            "place_of_crash_x_y_m": [round(x_m, 1), round(y_m, 1)],
            "vehicles": [_vehicle(vehicle) for vehicle in record.vehicles],
            "events": [
                {"number": event.number, "code": event.code, "party_1": event.party_1, "party_2": event.party_2}
                for event in record.events
            ],
        },
        "candidates": [offered.described() for offered in choices.offered],
    }


def _vehicle(vehicle: VehicleRecord) -> dict[str, object]:
    speed, limit = vehicle.travel_speed_mps, vehicle.speed_limit_mps
    return {
        "number": vehicle.number,
        "class": vehicle.vehicle_class.value,
        "length_m": vehicle.length_m,
        "width_m": vehicle.width_m,
        "travel_speed_mps": None if speed is None else round(speed, 2),
        "speed_limit_mps": None if limit is None else round(limit, 2),
        "lanes": vehicle.lanes,
        "movement": vehicle.movement.name.lower(),
        "crash_type_ACC_TYPE": vehicle.crash_type_code,
        "critical_event_P_CRASH2": vehicle.critical_event_code,
        "avoidance_P_CRASH3": vehicle.avoidance_code,
        "alignment_VALIGN": vehicle.alignment_code,
        "trafficway_VTRAFWAY": vehicle.trafficway_code,
        "impact_clock": _clock(vehicle.impact),
    }


def _clock(impact: ImpactArea | None) -> float | None:
    return None if impact is None else impact.clock_h
