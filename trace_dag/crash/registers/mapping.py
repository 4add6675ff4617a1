"""Mappings of registers: the columns of a table for each field, and the meanings of their values.

Columns are named after the FARS elements whose codes they are translated into (``MAN_COLL``, ``P_CRASH1``): any element
of a crash, a vehicle or a person in a record, so that no field needs code of its own. There is no expression language:
a value is looked up, a number has a unit, a time a format.
"""

from __future__ import annotations

import re
import tomllib
import zoneinfo
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from trace_dag.common.errors import UserError
from trace_dag.common.schemas import Column, ColumnType
from trace_dag.common.units import KG_PER_LB, METRES_PER_FOOT, MPS_PER_KMH, MPS_PER_MPH
from trace_dag.crash.codes.elements import HIGHEST_AGE, STATES
from trace_dag.crash.codes.table import code_table, has_codes, ranges
from trace_dag.crash.keys import FARS, REGISTER_NAME
from trace_dag.crash.record import LARGEST_ACCURACY_M, Moment, Octant
from trace_dag.crash.tables import CRASH_RECORD

PARKED: Final = "parked"
"""Values of ``P_CRASH1`` beside its codes: the unit was parked, not in transport."""
UNIT_KINDS: Final = ("vehicle", PARKED, "none")
"""Values of a unit beside a ``PER_TYP`` of a person outside vehicles; ``none``: there is no such unit."""
UNITS: Final[Mapping[str, float]] = {
    "m": 1.0,
    "ft": METRES_PER_FOOT,
    "km": 1000.0,
    "mi": 5280 * METRES_PER_FOOT,
    "km/h": MPS_PER_KMH,
    "mph": MPS_PER_MPH,
    "m/s": 1.0,
    "kg": 1.0,
    "lb": KG_PER_LB,
}
"""Factors from a unit to metres, m/s or kilograms."""
_TEXTS: Final = ("trafficway_1", "trafficway_2", "county_name", "city_name")
_NOT_MAPPED: Final = frozenset(
    {"STATE", "CaseYear", "YEAR", "MONTH", "DAY", "HOUR", "MINUTE", "ST_CASE", "PER_NO", "VEH_NO", "UNITTYPE"}
    | {"TRAV_SP", "VSPD_LIM", "MOD_YEAR", "PER_TYP", "PBPTYPE", "STR_VEH"}
)
"""Elements of records that a mapping says in another way, or that only FARS has."""
MOMENT: Final = ("year", "month", "day", "hour", "minute")
"""Parts of a crash's time; a part that no column holds is not reported."""
_DIRECTIVES: Final[Mapping[str, tuple[str, ...]]] = {
    **dict.fromkeys("Yy", ("year",)),
    **dict.fromkeys("mbB", ("month",)),
    "d": ("day",),
    "j": ("month", "day"),
    **dict.fromkeys("HI", ("hour",)),
    "M": ("minute",),
    **dict.fromkeys("pSfzaA%", ()),
}
"""Parts of a time that each directive of ``strftime`` holds."""
ISO8601: Final = "ISO8601"
EPOCHS: Final = {"epoch s": 1000, "epoch ms": 1}
"""Formats of numbers of seconds or milliseconds since 1970 UTC, with the milliseconds of one."""


def _register_name(name: str) -> str:
    if name == FARS or not REGISTER_NAME.fullmatch(name):
        raise ValueError("expected lower-case letters, digits and _, beginning with a letter; fars is taken")
    return name


def _unit_name(name: str) -> str:
    if name not in UNITS:
        raise ValueError(f"expected one of {', '.join(UNITS)}")
    return name


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class CodedColumn(_Part):
    """A column whose values are looked up; without ``values`` they are codes already.

    ``other`` is the code for values that are not listed, or ``unknown``.
    """

    column: str
    values: Mapping[str, int | str] = Field(default_factory=dict)
    other: int | str | None = None


class NumberColumn(_Part):
    """A column of numbers in a unit."""

    column: str
    unit: Annotated[str, AfterValidator(_unit_name)]

    @property
    def factor(self) -> float:
        """See :data:`UNITS`."""
        return UNITS[self.unit]


def _one_or_more(value: object) -> object:
    return (value,) if isinstance(value, str) else value


class TimeColumn(_Part):
    """One or more columns that hold the date and the time between them, each with its format.

    A format is one of ``strftime`` (``%m/%d/%Y %H:%M``), ``ISO8601``, ``epoch s`` or ``epoch ms``. One format for
    several columns is split at its blanks. ``zone``: the local time wanted, where the table has offsets from UTC.
    """

    column: Annotated[tuple[str, ...], BeforeValidator(_one_or_more), Field(min_length=1)]
    format: Annotated[tuple[str, ...], BeforeValidator(_one_or_more)]
    zone: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _split(cls, data: object) -> object:
        if isinstance(data, dict) and isinstance(data.get("column"), list) and isinstance(data.get("format"), str):
            return {**data, "format": data["format"].split(" ", len(data["column"]) - 1)}
        return data

    @model_validator(mode="after")
    def _can_be_read(self) -> TimeColumn:
        if len(self.column) != len(self.format):
            raise ValueError(f"{len(self.format)} formats of {len(self.column)} columns; expected one for each")
        held = Counter(part for each in self.format for part in parts_of(each))
        if twice := [part for part, count in held.items() if count > 1]:
            raise ValueError(f"the {twice[0]} is in it more than once")
        if "year" not in held:
            raise ValueError(f"no year in {' '.join(self.format)!r}; expected %Y, %y or {ISO8601}")
        offset = any(each in EPOCHS or each.endswith(("Z", "%z")) for each in self.format)
        if offset and (self.zone is None or len(self.column) > 1):
            raise ValueError('a time with an offset from UTC stands in one column, with zone = "America/Chicago" or so')
        if self.zone is not None and self.zone not in zoneinfo.available_timezones():
            raise ValueError(f"zone {self.zone!r} is not known; expected a name such as America/Chicago")
        return self


def parts_of(time_format: str) -> tuple[str, ...]:
    """Return the parts of a time in a format.

    Raises ValueError for an invalid format.

    >>> parts_of("%m/%d/%Y")
    ('month', 'day', 'year')
    """
    if time_format == ISO8601 or time_format in EPOCHS:
        return MOMENT
    found = re.findall("%(.?)", time_format.replace("%%", ""), re.DOTALL)
    for each in found:
        if each not in _DIRECTIVES:
            known = ", ".join(f"%{name}" for name in _DIRECTIVES)
            raise ValueError(
                f"%{each} in {time_format!r} is not known; expected {known}, {ISO8601}, {', '.join(EPOCHS)}"
            )
    if ("I" in found) != ("p" in found):
        raise ValueError(f"{time_format!r}: %I, the hour of twelve, needs %p beside it, AM or PM")
    return tuple(part for each in found for part in _DIRECTIVES[each])


class DirectionColumn(_Part):
    """A column of directions of the compass."""

    column: str
    values: Mapping[str, Octant]
    other: Literal["unknown"] | None = None


class HeadingColumn(DirectionColumn):
    """A column of directions of travel; ``turning``: whether those of turning units are from before or after a turn."""

    turning: Moment = Moment.UNKNOWN


class FromCrossingColumns(_Part):
    """The distance and direction of a crash on ``trafficway_1`` from the crossing with ``trafficway_2``.

    Blank or zero distances stand for the crossing itself.
    """

    distance: NumberColumn
    direction: DirectionColumn


class _Columns(BaseModel):
    """Columns, with further ones named after FARS elements."""

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)

    @cached_property
    def coded(self) -> dict[str, CodedColumn]:
        """Return the columns of FARS elements, by element."""
        return {name: CodedColumn.model_validate(value) for name, value in (self.model_extra or {}).items()}


class CrashColumns(_Columns):
    """Columns of the crash as a whole, the same in all rows of one crash.

    Its place is a point, or ``from_crossing``, which is looked up for crashes without a point.
    """

    id: str
    time: TimeColumn
    latitude_deg: str | None = None
    longitude_deg: str | None = None
    from_crossing: FromCrossingColumns | None = None
    trafficway_1: str | None = None
    trafficway_2: str | None = None
    county_name: str | None = None
    city_name: str | None = None
    narrative: str | None = None  # what happened, in words: read by a language model for what no column says


class UnitColumns(_Columns):
    """Columns of one unit, a vehicle or a person outside vehicles.

    ``{unit}`` in the name of a column stands for the unit where one row has several. ``AGE``, ``INJ_SEV`` and
    ``REST_USE`` are the driver's or the person's.
    """

    kind: CodedColumn | None = None  # vehicle, parked, none, or a PER_TYP; a vehicle where there is no such column
    heading: HeadingColumn | None = None
    make: str | None = None
    model: str | None = None
    MOD_YEAR: str | None = None
    TRAV_SP: NumberColumn | None = None
    VSPD_LIM: NumberColumn | None = None


class JoinedFile(_Part):
    """A file joined to that of the crashes by ``on``, which pairs its columns with those of earlier files.

    ``name`` is a pattern of file names (``*unit*.csv``). ``where``: the values that its rows must have, by column. Its
    first matching row adds columns; with ``units``, each of its rows is a unit, of the given ``kind`` if any (a value
    of :attr:`UnitColumns.kind`).
    """

    name: str
    on: Annotated[Mapping[str, str], Field(min_length=1)]
    where: Mapping[str, tuple[str, ...]] = Field(default_factory=dict)
    units: bool = False
    kind: int | str | None = None


class RegisterMapping(_Part):
    """A register: its name, owner, quality, and the reading of its table.

    ``rows``: whether a row is a crash, with ``units`` of it beside each other, or a unit. ``unknown``: values for "not
    known" in any column, beside blanks. ``table``: the pattern of the crashes' file in a folder, ``files`` those beside
    it. ``traffic``: the side it keeps; the default is that of the country around each point.
    """

    register_name: Annotated[str, AfterValidator(_register_name)] = Field(alias="register")
    name: str
    source: str
    licence: str
    attribution: str
    state: int | None = None  # FARS STATE
    rows: Literal["crash", "unit"]
    units: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    point_accuracy_m: float = Field(gt=0, le=LARGEST_ACCURACY_M)
    traffic: Literal["left", "right"] | None = None
    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = None  # else found in the header
    decimal: Literal[".", ","] = "."
    table: str = "*"
    files: tuple[JoinedFile, ...] = ()
    documented: str = ""  # where its columns and codes are, and as of when
    lacks_in_words: str = ""
    crash: CrashColumns
    unit: UnitColumns

    @model_validator(mode="after")
    def _can_be_read(self) -> RegisterMapping:
        if (self.rows == "crash") != bool(self.units):
            raise ValueError('units are named where rows = "crash", and only there')
        if self.state is not None and self.state not in STATES:
            raise ValueError(f"state {self.state} is no FARS code of a state")
        crash = self.crash
        if None in (crash.latitude_deg, crash.longitude_deg) and crash.from_crossing is None:
            raise ValueError("latitude_deg and longitude_deg are named, or from_crossing")
        if crash.from_crossing is not None and None in (crash.trafficway_1, crash.trafficway_2):
            raise ValueError("from_crossing is a place on trafficway_1, from where trafficway_2 crosses it: name both")
        of_unit = {*VEHICLE_FIELDS, *PERSON_FIELDS, *OCCUPANT_FIELDS}
        for columns, known in ((self.crash, {*CRASH_FIELDS, "PER_TYP"}), (self.unit, of_unit)):
            for element, column in columns.coded.items():
                if element not in known:
                    raise ValueError(f"{element} is not an element of a record; there are {', '.join(sorted(known))}")
                _check_codes(element, [*column.values.values(), *_said(column)])
        of_unit_kind = self.unit.kind
        kinds = [
            *((*of_unit_kind.values.values(), *_said(of_unit_kind)) if of_unit_kind else ()),
            *(file.kind for file in self.files),
        ]
        _check_codes("PER_TYP", [kind for kind in kinds if kind is not None and kind not in UNIT_KINDS])
        return self

    @property
    def credit(self) -> str:
        """Return the attribution of its reports, and their licence."""
        return f"{self.attribution}: {self.name} ({self.source}); licence: {self.licence}"

    @property
    def lacks(self) -> tuple[str, ...]:
        """Return the fields of vehicles that matter for the verdict and have no column."""
        asked = {"impact": "IMPACT1", "crash_type_code": "ACC_TYPE"}
        return tuple(field for field, element in asked.items() if element not in self.unit.coded)

    @property
    def covers(self) -> tuple[str, ...]:
        """Return the kinds of party that its crashes can have, as a text."""
        kinds = {file.kind for file in self.files} | set(self.unit.kind.values.values() if self.unit.kind else ())
        if "PER_TYP" in self.crash.coded:
            kinds |= set(self.crash.coded["PER_TYP"].values.values())
        moves = self.unit.coded.get("P_CRASH1")
        parked = PARKED in kinds or (moves is not None and PARKED in moves.values.values())
        words = {"pedestrians": 5 in kinds, "cyclists": 6 in kinds, "parked vehicles": parked}
        return ("vehicles", *(word for word, known in words.items() if known))

    def columns(self) -> Iterator[str]:
        """Yield every column of the table that is read."""
        crash, unit = self.crash, self.unit
        yield from (crash.id, *crash.time.column)
        texts = ("latitude_deg", "longitude_deg", *_TEXTS, "narrative")
        yield from (name for text in texts if (name := getattr(crash, text)) is not None)
        if crash.from_crossing is not None:
            yield from (crash.from_crossing.distance.column, crash.from_crossing.direction.column)
        yield from (column.column for column in crash.coded.values())
        of_unit: list[str | None] = [unit.make, unit.model, unit.MOD_YEAR]
        of_unit += [each.column for each in (unit.kind, unit.heading, unit.TRAV_SP, unit.VSPD_LIM) if each is not None]
        of_unit += [column.column for column in unit.coded.values()]
        for name in of_unit:
            if name is not None:
                yield from (self.column_of(name, each) for each in self.units or ("",))

    def column_of(self, name: str, unit: str) -> str:
        """Return a column of a unit."""
        return name.replace("{unit}", unit)


def list_shipped_mappings() -> list[str]:
    """Return names of the registers whose mappings are part of the package.

    >>> list_shipped_mappings()
    ['baac', 'chicago', 'cris', 'maryland', 'montgomery', 'nyc', 'penndot', 'stats19', 'tempe']
    """
    folder = resources.files("trace_dag.crash.registers")
    return sorted(each.name.removesuffix(".toml") for each in folder.iterdir() if each.name.endswith(".toml"))


def read_mapping(name: str) -> RegisterMapping:
    """Return the mapping of a register, by the name of a shipped one or by file.

    Raises UserError with the fault in it.

    >>> read_mapping("tempe").crash.id
    'Incidentid'
    """
    try:
        if name in list_shipped_mappings():
            data = resources.files("trace_dag.crash.registers").joinpath(f"{name}.toml").read_bytes()
        else:
            data = Path(name).read_bytes()
        return RegisterMapping.model_validate(tomllib.loads(data.decode()))
    except FileNotFoundError as error:
        raise UserError(
            f"{name}: neither a register of the package ({', '.join(list_shipped_mappings())}) nor a mapping file"
        ) from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UserError(f"{name} cannot be read as TOML: {error}") from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise UserError(
            f"{name}: {where}{': ' if where else ''}{first['msg'].removeprefix('Value error, ')}"
        ) from error


def _of_elements(columns: Iterable[Column]) -> dict[str, Column]:
    """Return the columns of records for a code, count or yes/no of a FARS element, by element."""
    coded = [each for each in columns if each.type in (ColumnType.INTEGER, ColumnType.BOOLEAN)]
    return {
        element: each for each in coded for element in each.source.split(", ") if element and element not in _NOT_MAPPED
    }


CRASH_FIELDS: Final[Mapping[str, Column]] = _of_elements(CRASH_RECORD.columns)
VEHICLE_FIELDS: Final[Mapping[str, Column]] = _of_elements(CRASH_RECORD["vehicles"].fields)
PERSON_FIELDS: Final[Mapping[str, Column]] = _of_elements(CRASH_RECORD["non_motorists"].fields)
"""Fields that a mapping can have of a crash, a vehicle and a person outside vehicles: columns of their records by
element."""
OCCUPANT_FIELDS: Final = {"INJ_SEV": "injury_code", "AGE": "age_years", "REST_USE": "restraint_code"}
NUMBERS: Final[Mapping[str, range]] = {
    "AGE": range(HIGHEST_AGE + 1),
    "VE_FORMS": range(1000),
    "FATALS": range(1000),
}
"""Elements that count, and have no codes, with what they can be."""


def _said(column: CodedColumn) -> list[int | str]:
    return [] if column.other in (None, "unknown") else [column.other]


def _check_codes(element: str, values: Iterable[int | str]) -> None:
    words = {PARKED} if element == "P_CRASH1" else set()
    if element not in NUMBERS and not has_codes(element):
        return
    known: Collection[int] = NUMBERS.get(element) or code_table(element).meanings
    for value in values:
        if value not in words and value not in known:
            raise ValueError(f"{element} has no code {value!r}; expected {', '.join((ranges(known), *words))}")
