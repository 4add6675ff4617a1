"""Records of a year that nobody prepared: real events, persons and places of the national tables, and vehicles drawn
to fit.

Nobody has a national release here with events, vehicles and maps all in one. The data at hand are the events and
persons of every fatal crash of 2016 without its accident and vehicle rows, the accident rows of 2015, and full
records of a few hundred crashes. So each crash of 2016 keeps its events, persons, damage and manoeuvres. Its time,
place, light and kind of road come from a crash of 2015 with the same first event, number of vehicles, manner of
collision and kind of area. Its vehicles come from a fully recorded crash of the same shape, with the areas of impact
and body types of the events. The choice does not depend on whether the program can reconstruct it."""

from __future__ import annotations

import csv
import io
import math
import random
import zipfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.crash.fars_tables import tables_of

Row = dict[str, str]

_EVENTS = ("cevent", "vevent", "vsoe", "pbtype", "nmprior", "nmcrash", "safetyeq", "damage", "maneuver", "parkwork")
_YEAR = "2016"
_IN_TRANSPORT, _PARKED, _OVERTURN, _PERSON, _CYCLIST = "12", "14", "1", "8", "9"
_SHAPES = (_IN_TRANSPORT, _PARKED, _OVERTURN, _PERSON, _CYCLIST)
# A_MANCOL of acc_aux (FARS Auxiliary Datasets Analytical User's Manual, ACC_AUX) by MAN_COLL.
_MANNERS = {"0": "1", "1": "2", "2": "3", "6": "4", "7": "5", "8": "5", "9": "6", "10": "6", "11": "6"}
# A_BODY of veh_aux (the same manual, VEH_AUX) by the last BODY_TYP of each of its groups.
_BODIES = ((11, "1"), (13, "9"), (16, "3"), (17, "1"), (19, "3"), (29, "4"), (39, "2"), (49, "5"), (59, "8"))
_HEAVIER = ((79, "6"), (89, "7"))
_CAR = "1"  # in place of the few bodies that none of the full records has
_OF_BODY = ("MAKE", "MODEL", "MAK_MOD", "BODY_TYP", "MOD_YEAR", "TOW_VEH", "GVWR", "V_CONFIG", "CARGO_BT", "UNITTYPE")
_NOT_HARMFUL = {*range(60, 72), 79}  # SOE: off the road, across its middle, airborne, ...
_UNKNOWN = "99"
_AVOIDANCES = {"0", "1", *map(str, range(5, 13)), "15", "16", "98", _UNKNOWN}  # P_CRASH3 as it was until 2016
_JUNCTIONS = ("2", "3")  # RELJCT2: at an intersection, or related to one
_NEAREST_DEG = 0.02  # two places of the same year are at least 2 km apart


@dataclass(frozen=True)
class MadeCrash:
    """A crash: its rows by table, where it is, and on what kind of road (``FUNC_SYS``; whether at a junction)."""

    case: str
    tables: Mapping[str, list[Row]]
    latitude_deg: float
    longitude_deg: float
    road_class: str
    at_junction: bool

    @property
    def accident(self) -> Row:
        """Return the row of ``accident``, which may still be written to."""
        return self.tables["accident"][0]


def made_crashes(shared: Path, number: int, seed: int = 1) -> list[MadeCrash]:
    """Return that many crashes, drawn from the whole country.

    ``shared`` is the folder of the shared data.
    """
    draw = random.Random(seed)
    national = shared / "fars-national"
    events = _rows_of_zip(national / "FARS2016-events-and-persons.zip")
    places = _Places(_rows_of_zip(national / "FARS2015-accident.zip")["accident"], draw)
    vehicles = _Vehicles(shared, draw)
    by_case = {name: _by(events[name], "ST_CASE") for name in (*_EVENTS, "veh_aux")}
    cases = [row for row in events["acc_aux"] if row["ST_CASE"] in by_case["cevent"]]
    draw.shuffle(cases)
    made: list[MadeCrash] = []
    for about in cases:
        if len(made) == number:
            break
        own = {name: rows.get(about["ST_CASE"], []) for name, rows in by_case.items()}
        crash = _made(about, own, places, vehicles)
        if crash is not None:
            made.append(crash)
    return sorted(made, key=lambda crash: int(crash.case))


def write_tables(crashes: Sequence[MadeCrash], folder: Path) -> None:
    """Write the crashes as CSV files of a national release."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("accident", "vehicle", *_EVENTS):
        rows = [row for crash in crashes for row in crash.tables[name]]
        columns = list(dict.fromkeys(column for row in rows for column in row))
        with (folder / f"{name}.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, columns, restval="")
            writer.writeheader()
            writer.writerows(rows)


def _made(about: Row, own: Mapping[str, list[Row]], places: _Places, vehicles: _Vehicles) -> MadeCrash | None:
    """Return one crash; None where no place of the country is like it, or nothing in it moved."""
    case = about["ST_CASE"]
    sequence = sorted(own["cevent"], key=lambda row: int(row["EVENTNUM"]))
    standing = {row["VEH_NO"] for row in own["parkwork"]}
    moving = sorted({row["VEH_NO"] for row in own["vevent"]} - standing, key=int)
    first_harm = next((row["SOE"] for row in sequence if int(row["SOE"]) not in _NOT_HARMFUL), _UNKNOWN)
    place = places.like(about, first_harm, len(moving)) if moving else None
    if place is None:
        return None
    accident = place | {
        "STATE": about["STATE"],
        "ST_CASE": case,
        "YEAR": _YEAR,
        "VE_TOTAL": str(len(moving) + len(standing)),
        "VE_FORMS": str(len(moving)),
        "PEDS": str(len(own["pbtype"])),
        "HARM_EV": first_harm,
        "COUNTY": about["COUNTY"],
        "FATALS": about["FATALS"],
    }
    drawn = vehicles.like(accident, moving, own)
    tables = {**{name: own[name] for name in _EVENTS}, "accident": [accident], "vehicle": drawn}
    return MadeCrash(
        case,
        tables,
        float(place["LATITUDE"]),
        float(place["LONGITUD"]),
        place["FUNC_SYS"],
        place["RELJCT2"] in _JUNCTIONS,
    )


class _Places:
    """Accident rows of a whole country; each is drawn at most once, and never one near another."""

    def __init__(self, rows: Iterable[Row], draw: random.Random) -> None:
        self._like: dict[tuple[str, ...], list[Row]] = defaultdict(list)
        self._taken: set[tuple[int, int]] = set()
        shuffled = [row for row in rows if row["FUNC_SYS"] in "1234567" and abs(float(row["LATITUDE"] or 99)) < 72]
        draw.shuffle(shuffled)
        for row in shuffled:
            for key in _keys(row, row["HARM_EV"], int(row["VE_FORMS"]), _MANNERS.get(row["MAN_COLL"], "7")):
                self._like[key].append(row)

    def like(self, about: Row, first_event: str, vehicles: int) -> Row | None:
        """Return a place of such a crash: of the same state and kind of area if there is one left."""
        wanted = {
            "STATE": about["STATE"],
            "RUR_URB": about["A_RU"],
            "RELJCT2": "2" if about["A_INTSEC"] == "1" else "1",
        }
        for key in _keys(wanted, first_event, vehicles, about["A_MANCOL"]):
            rows = self._like[key]
            while rows:
                row = rows.pop()
                if self._take(float(row["LATITUDE"]), float(row["LONGITUD"])):
                    return dict(row)
        return None

    def _take(self, latitude_deg: float, longitude_deg: float) -> bool:
        cell = (math.floor(latitude_deg / _NEAREST_DEG), math.floor(longitude_deg / _NEAREST_DEG))
        around = {(cell[0] + north, cell[1] + east) for north in (-1, 0, 1) for east in (-1, 0, 1)}
        if around & self._taken:
            return False
        self._taken.add(cell)
        return True


def _keys(row: Row, first_event: str, vehicles: int, manner: str) -> list[tuple[str, ...]]:
    """Return the facts that two crashes have to share to be alike, the most first."""
    junction = "at" if row["RELJCT2"] in _JUNCTIONS else "between"
    shape = (first_event, str(min(vehicles, 3)), manner)
    return [
        (*shape, row["RUR_URB"], junction, row["STATE"]),
        (*shape, row["RUR_URB"], junction),
        (*shape, row["RUR_URB"]),
        shape,
        (_shape(first_event), *shape[1:]),
    ]


def _shape(first_event: str) -> str:
    return first_event if first_event in _SHAPES else "object"


class _Vehicles:
    """Vehicles of the crashes that are fully recorded, by the shape of their crash and by their body."""

    def __init__(self, shared: Path, draw: random.Random) -> None:
        self._draw = draw
        self._crashes: dict[tuple[str, ...], list[list[Row]]] = defaultdict(list)
        self._bodies: dict[str, list[Row]] = defaultdict(list)  # of tables of until 2016
        self._columns: list[str] = []
        for folder in sorted((shared / "fars-csv").iterdir(), reverse=True):
            self._add(*(_read((folder / f"{name}.csv").read_bytes()) for name in ("accident", "vehicle")))
        tables = tables_of(_well_formed(shared / "va-2023" / "reports"))
        self._add(tables["accident"], tables["vehicle"], bodies=False)  # in codes that were not known yet

    def _add(self, accidents: Iterable[Row], vehicles: Iterable[Row], *, bodies: bool = True) -> None:
        of_case = _by((row for row in vehicles if row.get("P_CRASH1") and row.get("IMPACT1")), "ST_CASE")
        for accident in accidents:
            rows = [dict(row) for row in of_case.get(accident["ST_CASE"], ())]
            if not rows:
                continue
            self._columns = self._columns or list(rows[0])  # of the first, the tables of 2016
            shape = _shape(accident["HARM_EV"])
            if len(rows) > 1:
                self._crashes[shape, _MANNERS.get(accident["MAN_COLL"], "7")].append(rows)
            for row in rows:
                self._crashes[shape,].append([row])
                if bodies:
                    self._bodies[_body_group(row["BODY_TYP"])].append(row)

    def like(self, accident: Row, moving: Sequence[str], own: Mapping[str, list[Row]]) -> list[Row]:
        """Return a row for each vehicle that moved."""
        shape, manner = _shape(accident["HARM_EV"]), _MANNERS.get(accident["MAN_COLL"], "7")
        areas = _areas(moving, own["vevent"])
        bodies = {row["VEH_NO"]: row for row in own["veh_aux"]}
        drawn: list[Row] = []
        pairs = self._crashes[shape, manner] if len(moving) > 1 else []
        if pairs:
            drawn += self._fitting(pairs, [areas[number] for number in moving[:2]])
        alone = self._crashes[shape,] or self._crashes["object",]
        drawn += [self._fitting(alone, [areas[number]])[0] for number in moving[len(drawn) :]]
        return [
            self._row(row, accident, number, areas[number], bodies.get(number, {}), own)
            for number, row in zip(moving, drawn, strict=True)
        ]

    def _fitting(self, crashes: Sequence[Sequence[Row]], areas: Sequence[str]) -> list[Row]:
        """Return the vehicles, in the order of ``areas``, of one of the crashes in which they were struck most like
        that.
        """
        turned = [order for crash in crashes for order in (crash[: len(areas)], crash[: len(areas)][::-1])]
        off = [sum(map(_hours_apart, areas, (row["IMPACT1"] for row in rows))) for rows in turned]
        return list(self._draw.choice([rows for rows, each in zip(turned, off, strict=True) if each == min(off)]))

    def _row(self, like: Row, accident: Row, number: str, area: str, about: Row, own: Mapping[str, list[Row]]) -> Row:
        row = {column: like.get(column, "") for column in self._columns}
        row |= {name: accident[name] for name in accident if name in row}
        row |= {"VEH_NO": number, "IMPACT1": area}
        body = self._draw.choice(self._bodies.get(about.get("A_BODY", "")) or self._bodies[_CAR])
        row |= {name: body.get(name, "") for name in _OF_BODY if name in row}
        row["SPEEDREL"] = {"1": "5"}.get(row["SPEEDREL"], row["SPEEDREL"])  # a plain yes: how is not known
        row["P_CRASH3"] = row["P_CRASH3"] if row["P_CRASH3"] in _AVOIDANCES else _UNKNOWN
        if about.get("A_MOD_YR", "9999") < "2020":
            row["MOD_YEAR"] = about["A_MOD_YR"]
        overturned = [each for each in own["vevent"] if each["VEH_NO"] == number and each["SOE"] == _OVERTURN]
        row["ROLLOVER"] = ("2" if overturned[0]["VEVENTNUM"] != "1" else "1") if overturned else "0"
        return row


def _areas(moving: Iterable[str], events: Iterable[Row]) -> dict[str, str]:
    """Return the first area of impact of each vehicle, as a clock position (61 to 63 are the left and 81 to 83 the
    right).
    """
    found = dict.fromkeys(moving, "0")
    for row in sorted(events, key=lambda row: int(row["VEVENTNUM"])):
        for number, area in ((row["VNUMBER1"], row["AOI1"]), (row["VNUMBER2"], row["AOI2"])):
            if found.get(number) == "0" and (1 <= int(area) <= 14 or 60 < int(area) < 90):
                found[number] = area
    return found


def _hours_apart(one: str, other: str) -> float:
    hours = [_HOURS.get(each, float(each) if 1 <= float(each) <= 12 else None) for each in (one, other)]
    if hours[0] is None or hours[1] is None:
        return 3.0 if one != other else 0.0
    apart = abs(hours[0] - hours[1]) % 12
    return min(apart, 12 - apart)


_HOURS: dict[str, float | None] = {"61": 9.0, "62": 10.0, "63": 8.0, "81": 3.0, "82": 2.0, "83": 4.0}


def _body_group(body_type: str) -> str:
    code = int(body_type or 99)
    return next((group for last, group in (*_BODIES, *_HEAVIER) if code <= last), "9")


def _by(rows: Iterable[Row], column: str) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        found[row[column]].append(row)
    return dict(found)


def _rows_of_zip(path: Path) -> dict[str, list[Row]]:
    with zipfile.ZipFile(path) as file:
        return {name.partition(".")[0]: _read(file.read(name)) for name in file.namelist()}


def _read(data: bytes) -> list[Row]:
    return list(csv.DictReader(io.StringIO(data.decode("latin-1"))))


def _well_formed(folder: Path) -> list[bytes]:
    from lxml import etree

    found = []
    for path in sorted(folder.glob("*.xml")):
        data = path.read_bytes()
        try:
            etree.fromstring(data)
        except etree.XMLSyntaxError:
            continue
        found.append(data)
    return found
