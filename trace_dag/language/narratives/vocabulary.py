"""The vocabulary of narratives: fields of the crash, its units and its events, and the words for their values.

``words.toml`` has them, in the form of a register's mapping: its columns are the fields a model is asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final

from trace_dag.common.data_files import read_toml
from trace_dag.crash.registers.mapping import (
    CRASH_FIELDS,
    OCCUPANT_FIELDS,
    PERSON_FIELDS,
    UNITS,
    VEHICLE_FIELDS,
    CodedColumn,
    RegisterMapping,
)

CRASH: Final = 0
"""The unit that stands for the crash as a whole."""
SPEED_UNITS: Final = ("mph", "km/h", "m/s")
LENGTH_UNITS: Final = ("ft", "m", "mi", "km")
_MEASURE: Final = re.compile(r"(?P<number>\d+(?:\.\d+)?) ?(?P<unit>\S+)")
_NUMBER: Final = re.compile(r"\d+")


@dataclass(frozen=True)
class Field:
    """A field that can be read. ``values`` are the words of one that is coded; ``units`` of one that is measured.

    With neither it is a text, or with ``counts`` a number. ``name`` is its name in the record.
    """

    label: str
    name: str
    values: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    counts: bool = False

    def complaint(self, value: str) -> str | None:
        """Return a sentence on the fault of a value, or None if it is in the vocabulary.

        >>> Field("speed", "travel_speed_mps", units=SPEED_UNITS).complaint("fast")
        "'fast' is no value of speed: expected a number with its unit, mph, km/h or m/s"
        """
        if self.values:
            return None if value in self.values else f"{value!r} is no value of {self.label}"
        if self.units:
            match = _MEASURE.fullmatch(value)
            known = ", ".join(self.units[:-1]) + f" or {self.units[-1]}"
            good = match is not None and match["unit"] in self.units
            return None if good else f"{value!r} is no value of {self.label}: expected a number with its unit, {known}"
        if self.counts:
            return None if _NUMBER.fullmatch(value) else f"{value!r} is no value of {self.label}: expected a number"
        return None if value.strip() else f"{self.label} is empty"


def parse_measure(value: str) -> float:
    """Return a value with its unit, in metres or m/s.

    >>> round(parse_measure("45 mph"), 2), parse_measure("120 ft")
    (20.12, 36.576)
    """
    match = _MEASURE.fullmatch(value)
    if match is None:
        raise ValueError(f"{value!r} is no number with a unit")
    return float(match["number"]) * UNITS[match["unit"]]


@dataclass(frozen=True)
class Vocabulary:
    """Everything that can be read: ``mapping`` of the crash and its units, ``events`` with their codes (``SOE``)."""

    mapping: RegisterMapping
    events: Mapping[str, int]

    @cached_property
    def of_crash(self) -> dict[str, Field]:
        """Return fields of the crash, by label."""
        crash = self.mapping.crash
        found = [Field(str(getattr(crash, name)), name) for name in ("trafficway_1", "trafficway_2")]
        if crash.from_crossing is not None:
            found.append(Field(crash.from_crossing.distance.column, "place", units=LENGTH_UNITS))
            found.append(
                Field(crash.from_crossing.direction.column, "place", tuple(crash.from_crossing.direction.values))
            )
        return _by_label([*found, *_coded(crash.coded, {name: each.name for name, each in CRASH_FIELDS.items()})])

    @cached_property
    def of_unit(self) -> dict[str, Field]:
        """Return fields of a unit, by label."""
        unit = self.mapping.unit
        found = [Field(str(unit.make), "make_model"), Field(str(unit.model), "make_model")]
        found.append(Field(str(unit.MOD_YEAR), "model_year", counts=True))
        if unit.kind is not None:
            found.append(Field(unit.kind.column, "kind", tuple(unit.kind.values)))
        if unit.heading is not None:
            found.append(Field(unit.heading.column, "heading", tuple(unit.heading.values)))
        for column, name in ((unit.TRAV_SP, "travel_speed_mps"), (unit.VSPD_LIM, "speed_limit_mps")):
            if column is not None:
                found.append(Field(column.column, name, units=SPEED_UNITS))
        names = {name: each.name for name, each in {**PERSON_FIELDS, **VEHICLE_FIELDS}.items()}
        return _by_label([*found, *_coded(unit.coded, OCCUPANT_FIELDS | names | {"INJ_SEV": "injury_code"})])

    @cached_property
    def areas(self) -> Mapping[str, Any]:
        """Return codes of the parts of a vehicle that an event can name."""
        return self.mapping.unit.coded["IMPACT1"].values

    def field(self, unit: int, label: str) -> Field | None:
        """Return the field of the crash or of a unit with that label, or None."""
        return (self.of_crash if unit == CRASH else self.of_unit).get(label)

    @cached_property
    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of a model's answer."""
        facts = [_fact(field, of_crash=True) for field in self.of_crash.values()]
        facts += [_fact(field, of_crash=False) for field in self.of_unit.values()]
        unit = {"type": "integer", "minimum": 1}
        area = {"anyOf": [{"enum": list(self.areas)}, {"type": "null"}]}
        event = _object(
            event={"enum": list(self.events)},
            unit=unit,
            other_unit={"anyOf": [unit, {"type": "null"}]},
            area=area,
            other_area=area,
            words={"type": "string"},
        )
        return _object(facts={"type": "array", "items": {"anyOf": facts}}, events={"type": "array", "items": event})


def _coded(columns: Mapping[str, CodedColumn], names: Mapping[str, str]) -> Iterator[Field]:
    for element, column in columns.items():
        yield Field(column.column, names[element], tuple(column.values), counts=not column.values)


def _by_label(fields: list[Field]) -> dict[str, Field]:
    return {field.label: field for field in fields}


def _fact(field: Field, *, of_crash: bool) -> dict[str, Any]:
    unit: dict[str, Any] = {"const": CRASH} if of_crash else {"type": "integer", "minimum": 1}
    value: dict[str, Any] = {"enum": list(field.values)} if field.values else {"type": "string"}
    if field.units:
        value["description"] = f"a number with its unit: {', '.join(field.units)}"
    return _object(unit=unit, field={"const": field.label}, value=value, words={"type": "string"})


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


@cache
def vocabulary() -> Vocabulary:
    """Return the vocabulary.

    >>> vocabulary().of_unit["movement"].values[:2]
    ('going straight', 'slowing down')
    """
    said = read_toml("trace_dag.language.narratives", "words.toml")
    return Vocabulary(events=said.pop("events"), mapping=RegisterMapping.model_validate(said))
