"""Persons outside motor vehicles: ``NPersons`` with what the crash's typing and the tables of their acts add.

A person is the same in all tables by ``PER_NO`` (``VEH_NO`` is 0). National files without the person table still tell
of it in the others, so that any of them makes a person.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from trace_dag.crash.codes import crash as crash_codes
from trace_dag.crash.codes import persons as codes
from trace_dag.crash.codes.table import CodeTable, UnknownCodeError
from trace_dag.crash.fields import Fields
from trace_dag.crash.record import NonMotorist, VehicleRecord

_UNKNOWN_KIND: Final = 19
_CYCLISTS: Final = frozenset({6, 7})
_LISTS: Final = ("NPersons", "PbTypes", "NmPriors", "NmCrashes", "SafetyEQs")
_NO_VEHICLE: Final = (None, 0)


def read_non_motorists(
    crash: Fields, vehicles: Sequence[VehicleRecord]
) -> tuple[tuple[NonMotorist, ...], tuple[str, ...]]:
    """The persons in order of their numbers, and what is said of vehicles that are not there, in words.

    Raises :class:`UnknownCodeError` for a code that its element does not have.
    """
    rows: dict[int, dict[str, list[Fields]]] = {}
    for name in _LISTS:
        for element in crash.members(name):
            row = Fields(element, f"{crash.where}: {name}", crash.year)
            number, kind = row.integer("PER_NO"), row.code(crash_codes.PER_TYP)
            if number is None or row.integer("VEH_NO") not in _NO_VEHICLE or kind in crash_codes.VEHICLE_OCCUPANTS:
                continue
            row.where = f"{row.where}, person {number}"
            rows.setdefault(number, {each: [] for each in _LISTS})[name].append(row)
    persons = tuple(_person(number, rows[number]) for number in sorted(rows))
    listed = {vehicle.number for vehicle in vehicles}
    strays = tuple(
        f"person {person.number}: STR_VEH says that vehicle {person.striking_vehicle} struck it, which the report does "
        "not list"
        for person in persons
        if person.striking_vehicle is not None and person.striking_vehicle not in listed
    )
    return persons, strays


def _person(number: int, rows: dict[str, list[Fields]]) -> NonMotorist:
    person, typing = rows["NPersons"][:1], rows["PbTypes"][:1]
    equipment = rows["SafetyEQs"]
    kind = _first(person, crash_codes.PER_TYP)
    if kind is None:
        kind = _first(typing, crash_codes.PER_TYP, "PBPTYPE")
    helmet, pads, other_protection, reflective, lights, other_prevention = (
        _first(equipment, table) for table in codes.EQUIPMENT
    )
    return NonMotorist(
        number=number,
        person_type_code=_UNKNOWN_KIND if kind is None else kind,
        striking_vehicle=next((row.integer("STR_VEH") for row in person), None) or None,
        age_years=_age([*person, *typing]),
        sex_code=_either(_first(person, codes.SEX), _first(typing, codes.SEX, "PBSEX")),
        location_code=_first(person, codes.LOCATION),
        crosswalk_code=_first(typing, codes.PBCWALK),
        sidewalk_code=_first(typing, codes.PBSWALK),
        school_zone_code=_first(typing, codes.PBSZONE),
        intersection_code=_first(typing, codes.BIKELOC if kind in _CYCLISTS else codes.PEDLOC),
        pedestrian_position_code=_first(typing, codes.PEDPOS),
        cyclist_position_code=_first(typing, codes.BIKEPOS),
        pedestrian_direction_code=_first(typing, codes.PEDDIR),
        cyclist_direction_code=_first(typing, codes.BIKEDIR),
        motorist_direction_code=_first(typing, codes.MOTDIR),
        motorist_manoeuvre_code=_first(typing, codes.MOTMAN),
        intersection_leg_code=_first(typing, codes.PEDLEG),
        scenario=next((_scenario(row) for row in typing), ""),
        pedestrian_group_code=_first(typing, codes.PEDCGP),
        cyclist_group_code=_first(typing, codes.BIKECGP),
        pedestrian_type_code=_first(typing, codes.PEDCTYPE),
        cyclist_type_code=_first(typing, codes.BIKECTYPE),
        actions=_all(rows["NmPriors"], codes.NMACTION, "NMACTION", "MPR_ACT"),
        circumstances=_all(rows["NmCrashes"], codes.NMCC, "NMCC", "MTM_CRSH"),
        equipment=_all(equipment, codes.MSAFEQMT),
        helmet_code=helmet,
        pads_code=pads,
        other_protection_code=other_protection,
        reflective_clothing_code=reflective,
        lights_code=lights,
        other_prevention_code=other_prevention,
    )


def _first(rows: Sequence[Fields], table: CodeTable, *names: str) -> int | None:
    return next((code for row in rows if (code := row.known_code(table, *names)) is not None), None)


def _all(rows: Sequence[Fields], table: CodeTable, *names: str) -> tuple[int, ...]:
    found = (row.known_code(table, *names) for row in rows)
    return tuple(sorted({code for code in found if code is not None}))


def _either(one: int | None, other: int | None) -> int | None:
    return other if one is None else one


def _age(rows: Sequence[Fields]) -> int | None:
    ages = (row.integer("AGE", "PBAGE", low=0) for row in rows)
    return next((age for age in ages if age is not None and age <= codes.HIGHEST_AGE), None)


def _scenario(row: Fields) -> str:
    text = row.text("PEDSNR").lower()
    if text in codes.PEDSNR:
        return text
    if text and text not in codes.PEDSNR_UNKNOWN:
        raise UnknownCodeError("PEDSNR", text, row.year, "1a-12d, 7, 8, 99")
    return ""
