"""Persons outside motor vehicles: ``NPersons``, with the crash typing and the tables of their actions.

``PER_NO`` identifies a person in all tables (``VEH_NO`` is 0). If national files lack the person table, a row in any
other table of persons is enough to make one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.table import UnknownCodeError, code_table
from trace_dag.crash.fields import Fields, known_codes
from trace_dag.crash.parties import HIGHEST_NUMBER, UNKNOWN_NON_MOTORIST
from trace_dag.crash.record import NonMotorist, VehicleRecord

_CYCLISTS: Final = frozenset({6, 7})
_LISTS: Final = {
    "NPersons": "person",
    "PbTypes": "pbtype",
    "NmPriors": "nmprior",
    "NmCrashes": "nmcrash",
    "SafetyEQs": "safetyeq",
}
"""Tables of persons outside vehicles, by CrashAPI's names, which messages have."""
_NO_VEHICLE: Final = (None, 0)
_PLACES: Final = {"NPersons": ("LOCATION",), "PbTypes": ("PEDPOS", "BIKEPOS")}

_Rows: TypeAlias = dict[int, dict[str, list[Fields]]]
"""Rows by ``PER_NO`` and list."""


@dataclass(frozen=True)
class ReadPersons:
    """The persons in order of their numbers, with sentences on contradictions and open questions."""

    non_motorists: tuple[NonMotorist, ...]
    contradictions: tuple[str, ...] = ()
    ambiguities: tuple[str, ...] = ()


def read_non_motorists(crash: Fields, vehicles: Sequence[VehicleRecord]) -> ReadPersons:
    """Return the persons outside the vehicles of a crash, from all tables that name them.

    Raises :class:`UnknownCodeError` for a code that its element does not have.

    >>> crash = Fields({}, "a report", 2023, {"person": [{"VEH_NO": "0", "PER_NO": "1", "PER_TYP": "5"}]})
    >>> read_non_motorists(crash, []).non_motorists[0].kind.value  # PER_TYP 5
    'pedestrian'
    """
    rows: _Rows = {}
    misplaced: dict[str, None] = {}
    for name, table in _LISTS.items():
        for row in crash.rows(table, name):
            vehicle, kind = row.integer("VEH_NO"), row.integer("PER_TYP")
            if kind in codes.VEHICLE_OCCUPANTS or (table == "person" and vehicle and kind is None):
                continue
            number = row.integer("PER_NO", low=0, high=HIGHEST_NUMBER)
            if number is None or vehicle not in _NO_VEHICLE:
                whose = f"person {number} of vehicle {vehicle}" if number is not None else "nobody (PER_NO is missing)"
                misplaced.setdefault(f"{name} has a row of {whose}, which is not a person outside the vehicles")
                continue
            row.where = f"{row.where}, person {number}"
            rows.setdefault(number, {each: [] for each in _LISTS})[name].append(row)
    persons = tuple(_person(number, rows[number]) for number in sorted(rows))
    return ReadPersons(
        persons,
        (*misplaced, *_unlisted(rows), *_in_two_places(rows), *_ages_apart(rows), *_strays(persons, vehicles)),
        tuple(f"person {number}: {said}" for number in sorted(rows) if (said := _unknown_age(rows[number]))),
    )


def _strays(persons: Sequence[NonMotorist], vehicles: Sequence[VehicleRecord]) -> Iterator[str]:
    listed = {vehicle.number for vehicle in vehicles}
    for person in persons:
        if person.striking_vehicle is not None and person.striking_vehicle not in listed:
            yield (
                f"person {person.number}: STR_VEH says that vehicle {person.striking_vehicle} struck it, which the "
                "report does not list"
            )


def _unlisted(rows: _Rows) -> Iterator[str]:
    """Yield sentences on persons missing in ``NPersons``, if that lists any."""
    if not any(of_person["NPersons"] for of_person in rows.values()):
        return
    for number, of_person in sorted(rows.items()):
        if not of_person["NPersons"]:
            tables = ", ".join(name for name in _LISTS if of_person[name])
            yield f"person {number}: {tables} tell of it, but NPersons does not list it"


def _in_two_places(rows: _Rows) -> Iterator[str]:
    """Yield sentences on persons whose rows in a table with one row each give different places."""
    for number, of_person in sorted(rows.items()):
        for name, elements in _PLACES.items():
            for element in elements:
                said = list(dict.fromkeys(row.known_code(element) for row in of_person[name]))
                places = [f"{code_table(element).meaning(code)} ({code})" for code in said if code is not None]
                if len(places) > 1:
                    yield f"person {number}: {element} says {' and '.join(places)}; the first is taken"


def _ages_apart(rows: _Rows) -> Iterator[str]:
    for number, of_person in sorted(rows.items()):
        ages = {age for row in _aged(of_person) if (age := _age([row])) is not None}
        if len(ages) > 1:
            yield f"person {number}: its age is given as {' and '.join(map(str, sorted(ages)))}"
        for row in _aged(of_person):
            stated = row.integer("AGE", "PBAGE")
            if stated is not None and stated not in codes.AGE_UNKNOWN and not 0 <= stated <= codes.HIGHEST_AGE:
                yield f"person {number}: {stated} is not an age in years; expected 0 to {codes.HIGHEST_AGE}, 998 or 999"


def _unknown_age(of_person: dict[str, list[Fields]]) -> str:
    """Return a note if a person's age is coded as unknown, else None."""
    stated = [row.integer("AGE", "PBAGE") for row in _aged(of_person)]
    unknown = next((age for age in stated if age in codes.AGE_UNKNOWN), None)
    return f"its age is not known ({unknown})" if unknown is not None and _age(_aged(of_person)) is None else ""


def _aged(of_person: dict[str, list[Fields]]) -> list[Fields]:
    return [*of_person["NPersons"], *of_person["PbTypes"]]


def _person(number: int, rows: dict[str, list[Fields]]) -> NonMotorist:
    person, typing = rows["NPersons"][:1], rows["PbTypes"][:1]
    equipment = rows["SafetyEQs"]
    kind = _first([*person, *typing], "PER_TYP", "PER_TYP", "PBPTYPE")
    return NonMotorist(
        number=number,
        person_type_code=UNKNOWN_NON_MOTORIST if kind is None else kind,
        striking_vehicle=next((row.integer("STR_VEH") for row in person), None) or None,
        injury_code=next((code_table("INJ_SEV").known(row.integer("INJ_SEV")) for row in person), None),
        age_years=_age([*person, *typing]),
        sex_code=_first([*person, *typing], "SEX", "SEX", "PBSEX"),
        location_code=_first(person, "LOCATION"),
        crosswalk_code=_first(typing, "PBCWALK"),
        sidewalk_code=_first(typing, "PBSWALK"),
        school_zone_code=_first(typing, "PBSZONE"),
        intersection_code=_first(typing, "BIKELOC" if kind in _CYCLISTS else "PEDLOC"),
        pedestrian_position_code=_first(typing, "PEDPOS"),
        cyclist_position_code=_first(typing, "BIKEPOS"),
        pedestrian_direction_code=_first(typing, "PEDDIR"),
        cyclist_direction_code=_first(typing, "BIKEDIR"),
        motorist_direction_code=_first(typing, "MOTDIR"),
        motorist_manoeuvre_code=_first(typing, "MOTMAN"),
        intersection_leg_code=_first(typing, "PEDLEG"),
        scenario=next((_scenario(row) for row in typing), ""),
        pedestrian_group_code=_first(typing, "PEDCGP"),
        cyclist_group_code=_first(typing, "BIKECGP"),
        pedestrian_type_code=_first(typing, "PEDCTYPE"),
        cyclist_type_code=_first(typing, "BIKECTYPE"),
        actions=known_codes(rows["NmPriors"], "NMACTION", "NMACTION", "MPR_ACT"),
        circumstances=known_codes(rows["NmCrashes"], "NMCC", "NMCC", "MTM_CRSH"),
        equipment=known_codes(equipment, "MSAFEQMT"),
        helmet_code=_first(equipment, "NMHELMET"),
        pads_code=_first(equipment, "NMPROPAD"),
        other_protection_code=_first(equipment, "NMOTHPRO"),
        reflective_clothing_code=_first(equipment, "NMREFCLO"),
        lights_code=_first(equipment, "NMLIGHT"),
        other_prevention_code=_first(equipment, "NMOTHPRE"),
    )


def _first(rows: Sequence[Fields], element: str, *names: str) -> int | None:
    return next((code for row in rows if (code := row.known_code(element, *names)) is not None), None)


def _age(rows: Sequence[Fields]) -> int | None:
    ages = (row.within(0, codes.HIGHEST_AGE, "AGE", "PBAGE") for row in rows)
    return next((age for age in ages if age is not None), None)


def _scenario(row: Fields) -> str:
    text = row.text("PEDSNR").lower()
    if text in codes.PEDSNR:
        return text
    if text and text not in codes.PEDSNR_UNKNOWN:
        raise UnknownCodeError("PEDSNR", text, row.year, "1a-12d, 7, 8, 99")
    return ""
