"""Messages from a prompt file and a crash.

Text from reports and maps goes into the prompt as JSON with its angle brackets escaped, inside a fence that the system
message declares to be data. So no text of a report can close the fence or look like a message.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from string import Template
from typing import get_args

from trace_dag.common.errors import UserError
from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.language.answer import Kind, form
from trace_dag.language.choices import Choices

_LONGEST_TEXT = 2000
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")

Message = dict[str, str]


@dataclass(frozen=True)
class PromptFile:
    """A file with the templates of a system message and of a question, and a digest of its text."""

    system: Template
    user: Template
    digest: str

    @classmethod
    def read(cls, file: Traversable) -> PromptFile:
        """Return the templates of a file."""
        text = file.read_text(encoding="utf-8")
        system, user = text.removeprefix("# system\n").split("\n# user\n")
        return cls(Template(system), Template(user), hashlib.sha256(text.encode()).hexdigest()[:16])

    def messages(self, values: Mapping[str, str]) -> list[Message]:
        """Return both messages with these values."""
        return [
            {"role": "system", "content": self.system.substitute(values).strip()},
            {"role": "user", "content": self.user.substitute(values).strip()},
        ]


@dataclass(frozen=True)
class Prompt:
    """One version of the prompt: its name, its kind, and its templates."""

    version: str
    kind: Kind
    file: PromptFile

    @classmethod
    def load(cls, version: str) -> Prompt:
        """Return the prompt of that name.

        Raises :class:`UserError` that lists the known names if it is unknown.
        """
        folder = files("trace_dag.language") / "prompts"
        names = [entry.name.removesuffix(".md") for entry in folder.iterdir() if entry.name.endswith(".md")]
        kinds = {name: kind for name in names for kind in get_args(Kind) if name.startswith(f"{kind}-v")}
        if version not in kinds:
            known = ", ".join(sorted(kinds))
            raise UserError(f"no prompt is called {version!r}; set states.llm_prompt to one of {known}")
        return cls(version, kinds[version], PromptFile.read(folder / f"{version}.md"))

    def messages(self, record: CrashRecord, choices: Choices, *, lead_time_s: float) -> list[Message]:
        """Return the first question about a crash."""
        schema = json.dumps(form(self.kind).model_json_schema(), sort_keys=True)
        data = fence(_data(record, choices))
        return self.file.messages({"lead_time_s": f"{lead_time_s:g}", "schema": schema, "data": data})


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
        "impact_clock": None if vehicle.impact is None else vehicle.impact.clock_h,
    }
