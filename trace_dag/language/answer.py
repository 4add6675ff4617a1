"""The two forms of a model's answer, and the check of an answer.

Every complaint is a sentence that the model can act on; it goes into the next prompt.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.language.choices import Choices, OfferedApproach
from trace_dag.language.store import REFUSED, TOO_LONG, StoredAnswer
from trace_dag.reconstruction.motion.speeds import brakes, starts

MAX_PLACE_M = 15.0
HEADING_TOLERANCE_DEG = 30.0
WRONG_SIDE_DEG = 120.0
SPEED_SHARE = 0.5  # share of the distance that a reported speed covers


class _Form(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class Place(_Form):
    """A point in the local frame, metres."""

    x_m: float = Field(allow_inf_nan=False)
    y_m: float = Field(allow_inf_nan=False)


class SegmentChoice(_Form):
    """One vehicle in a ``segments`` answer."""

    vehicle_number: int
    candidate: str = Field(description="id of one of this vehicle's candidate approaches")
    road: str | None = Field(None, description="the candidate's road")
    lane: int | None = Field(None, description="the candidate's lane")
    position_m: float = Field(allow_inf_nan=False, description="metres before the crash along the approach")
    heading_deg: float = Field(allow_inf_nan=False, description="degrees counter-clockwise from east at that position")


class SegmentsAnswer(_Form):
    """Answer to a ``segments`` prompt."""

    reasoning: str
    vehicles: list[SegmentChoice]
    crash: Place


class StartPoint(_Form):
    """One vehicle in a ``coordinates`` answer."""

    vehicle_number: int
    x_m: float = Field(allow_inf_nan=False)
    y_m: float = Field(allow_inf_nan=False)
    heading_deg: float = Field(allow_inf_nan=False, description="degrees counter-clockwise from east")


class CoordinatesAnswer(_Form):
    """Answer to a ``coordinates`` prompt."""

    reasoning: str
    vehicles: list[StartPoint]
    crash: Place


Kind = Literal["segments", "coordinates"]
T = TypeVar("T", bound=BaseModel)
_NO_ANSWER: Final = {
    REFUSED: "The model refused to answer. This is traffic safety research on a public police report.",
    TOO_LONG: "The question is longer than the model's context.",
    "length": "The answer was cut off before its end. Keep it shorter.",
}
"""Faults of answers by the way in which they ended."""


@dataclass(frozen=True)
class Decision:
    """A checked answer: each vehicle's approach."""

    offered: dict[int, OfferedApproach]
    reasoning: str


class WrongAnswer(Exception):  # noqa: N818 - an outcome that is counted, not an error of ours
    """An answer that cannot be used; ``complaints`` say why, for the next prompt."""

    def __init__(self, complaints: list[str]) -> None:
        super().__init__("; ".join(complaints))
        self.complaints = complaints


def form(kind: Kind) -> type[SegmentsAnswer] | type[CoordinatesAnswer]:
    """Return the answer's form for a kind of prompt.

    >>> form("segments").__name__
    'SegmentsAnswer'
    """
    return SegmentsAnswer if kind == "segments" else CoordinatesAnswer


def schema_of(kind: Kind, choices: Choices) -> dict[str, Any]:
    """Return the JSON schema for an answer about one crash, with the offered candidates as the allowed ones.

    >>> schema_of("segments", Choices(scene, ()))["$defs"]["SegmentChoice"]["properties"]["candidate"]["enum"]
    []
    """
    schema = form(kind).model_json_schema()
    if kind == "segments":
        candidate = schema["$defs"]["SegmentChoice"]["properties"]["candidate"]
        candidate["enum"] = [offered.id for offered in choices.offered]
    return schema


def text_of(answer: StoredAnswer) -> str:
    """Return the text of an answer.

    Raises :class:`WrongAnswer` for a refused or incomplete one.

    >>> text_of(StoredAnswer("{", "length", "a-model", 900, 5, 0.0, 1.0))
    Traceback (most recent call last):
    trace_dag.language.answer.WrongAnswer: The answer was cut off before its end. Keep it shorter.
    """
    if answer.finish_reason in _NO_ANSWER:
        raise WrongAnswer([_NO_ANSWER[answer.finish_reason]])
    return answer.text


def parse(text: str, wanted: type[T]) -> T:
    """Read an answer; Markdown fences around the JSON are allowed. Raises :class:`WrongAnswer`.

    >>> parse("", SegmentsAnswer)
    Traceback (most recent call last):
    trace_dag.language.answer.WrongAnswer: The answer was empty. Answer with one JSON object.
    """
    stripped = text.strip()
    if not stripped:
        raise WrongAnswer(["The answer was empty. Answer with one JSON object."])
    if stripped.startswith("```"):
        stripped = stripped.strip("`").removeprefix("json").strip()
    try:
        return wanted.model_validate_json(stripped)
    except ValidationError as error:
        if not _is_json(stripped):
            raise WrongAnswer(
                ["The answer was not valid JSON. Answer with one JSON object and nothing else."]
            ) from error
        complaints = [
            f"{'.'.join(str(part) for part in each['loc']) or 'the answer'}: {each['msg']}"
            for each in error.errors()[:5]
        ]
        raise WrongAnswer(complaints) from error


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):  # nested too deep
        return False
    return True


def decide(
    answer: SegmentsAnswer | CoordinatesAnswer,
    choices: Choices,
    record: CrashRecord,
    numbers: tuple[int, int],
    *,
    lead_time_s: float,
) -> Decision:
    """Return the approaches that an answer chooses.

    Raises :class:`WrongAnswer` with all faults of the answer.

    >>> answer = SegmentsAnswer(reasoning="", vehicles=[], crash=Place(x_m=0.0, y_m=0.0))
    >>> decide(answer, Choices(scene, ()), record, (1, 2), lead_time_s=5.0)
    Traceback (most recent call last):
    trace_dag.language.answer.WrongAnswer: The answer names vehicles []; it must name 1 and 2, once each.
    """
    complaints: list[str] = []
    given = [each.vehicle_number for each in answer.vehicles]
    if sorted(given) != sorted(numbers):
        raise WrongAnswer(
            [f"The answer names vehicles {given}; it must name {numbers[0]} and {numbers[1]}, once each."]
        )
    place_x, place_y = choices.scene.place_xy_m
    away_m = math.hypot(answer.crash.x_m - place_x, answer.crash.y_m - place_y)
    if away_m > MAX_PLACE_M:
        complaints.append(
            f"The crash is put {away_m:.0f} m from the reported place ({place_x:.0f}, {place_y:.0f}); "
            f"it must lie within {MAX_PLACE_M:.0f} m."
        )
    vehicles = {vehicle.number: vehicle for vehicle in record.vehicles}
    found: dict[int, list[tuple[OfferedApproach, float]]] = {}
    for each in answer.vehicles:
        found[each.vehicle_number] = (
            _segment(each, choices, complaints)
            if isinstance(each, SegmentChoice)
            else _point(each, choices, complaints)
        )
    chosen = _leading_to_the_crash(found, choices)
    for number, (_, position_m) in chosen.items():
        complaint = _position_complaint(vehicles[number], position_m, lead_time_s)
        if complaint:
            complaints.append(complaint)
    if complaints:
        raise WrongAnswer(complaints)
    return Decision({number: offered for number, (offered, _) in chosen.items()}, answer.reasoning)


def _leading_to_the_crash(
    found: dict[int, list[tuple[OfferedApproach, float]]], choices: Choices
) -> dict[int, tuple[OfferedApproach, float]]:
    """Return the first approaches, one per vehicle, on which some candidate meets; else the nearest ones."""
    known = {number: offered for number, offered in found.items() if offered}
    pairs = [dict(zip(known, pair, strict=True)) for pair in product(*known.values())]
    if len(known) < len(found):
        return pairs[0]
    meeting = (pair for pair in pairs if choices.chosen({number: each for number, (each, _) in pair.items()}))
    return next(meeting, pairs[0])


def _segment(choice: SegmentChoice, choices: Choices, complaints: list[str]) -> list[tuple[OfferedApproach, float]]:
    who = f"Vehicle {choice.vehicle_number}"
    offered = choices.by_id(choice.candidate)
    if offered is None:
        known = ", ".join(each.id for each in choices.offered)
        complaints.append(f"{who}: there is no candidate {choice.candidate[:40]!r}; the candidates are {known}.")
        return []
    if choice.vehicle_number not in offered.vehicles:
        open_to = ", ".join(each.id for each in choices.offered if choice.vehicle_number in each.vehicles)
        complaints.append(f"{who}: candidate {offered.id} is not open to it; choose from {open_to}.")
        return []
    road = offered.approach.road
    if choice.road is not None and choice.road != (road.id if road is not None else None):
        complaints.append(
            f"{who}: candidate {offered.id} is on road {road.id if road is not None else None}, "
            f"not {choice.road[:40]!r}."
        )
        return []
    lane = offered.approach.lanes[0].lane_id if offered.approach.lanes else None
    if choice.lane is not None and choice.lane != lane:
        complaints.append(f"{who}: candidate {offered.id} is lane {lane}, not {choice.lane}.")
        return []
    if not 0.0 <= choice.position_m <= max(offered.length_m, 1.0):
        complaints.append(
            f"{who}: position {choice.position_m:.0f} m lies outside the road: candidate {offered.id} is known "
            f"from 0 to {offered.length_m:.0f} m before the crash."
        )
        return []
    direction = offered.heading_deg(choice.position_m)
    apart = abs(math.remainder(direction - choice.heading_deg, 360.0))
    if apart > HEADING_TOLERANCE_DEG:
        side = " That is the wrong side of the road." if apart > WRONG_SIDE_DEG else ""
        complaints.append(
            f"{who}: heading {choice.heading_deg:.0f} deg disagrees with candidate {offered.id}, which leads "
            f"{direction:.0f} deg there.{side}"
        )
        return []
    return [(offered, choice.position_m)]


def _point(point: StartPoint, choices: Choices, complaints: list[str]) -> list[tuple[OfferedApproach, float]]:
    who = f"Vehicle {point.vehicle_number}"
    offered = choices.at(point.x_m, point.y_m, point.heading_deg, point.vehicle_number)
    if not offered:
        reverse = choices.at(point.x_m, point.y_m, point.heading_deg + 180.0, point.vehicle_number)
        why = "is on the wrong side of the road" if reverse else "lies outside the lanes that lead to the crash"
        complaints.append(
            f"{who}: the point ({point.x_m:.0f}, {point.y_m:.0f}) with heading {point.heading_deg:.0f} deg {why}."
        )
    stations = (offered.approach.path.project(point.x_m, point.y_m)[0] for offered in offered)
    return [(each, each.approach.station_m - station) for each, station in zip(offered, stations, strict=True)]


def _position_complaint(vehicle: VehicleRecord, position_m: float, lead_time_s: float) -> str | None:
    speed = vehicle.travel_speed_mps
    if speed is None or brakes(vehicle) or starts(vehicle, speed):
        return None
    expected_m = speed * lead_time_s
    if abs(position_m - expected_m) <= max(SPEED_SHARE * expected_m, 10.0):
        return None
    return (
        f"Vehicle {vehicle.number}: {position_m:.0f} m before the crash disagrees with its reported speed of "
        f"{speed:.1f} m/s, which covers {expected_m:.0f} m in {lead_time_s:g} s."
    )
