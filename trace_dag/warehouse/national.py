"""Coverage of a country's fatal crashes: kinds of national tables, rates of stored crashes.

A national table has every crash, but neither its sequence nor a map; the crashes of a root have both. So the kinds are
counted in the table, and each kind gets the success rates of its stored crashes: complete reports, usable maps among
those with a map at hand, and verified ones among these. It is an estimate. It assumes that within a kind the stored
crashes are like the country's, that OpenStreetMap covers the country equally well, and that the kind follows from the
first harmful event and the number of vehicles alone. The same tables give weights to the crashes of a release.
"""

from __future__ import annotations

import io
import zipfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import csv

from trace_dag.common.errors import UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.crash.classes import JUDGED_KINDS, CrashKind, RoadTopology, kind_of_codes, road_topology
from trace_dag.crash.codes.elements import FUNC_SYS_OF_ROAD_FNC
from trace_dag.warehouse.query import open_warehouse

_COLUMNS: Final = ("HARM_EV", "VE_FORMS")
_DRAWS: Final = 20_000
_TAILS_PCT: Final = (5.0, 95.0)
_RATES: Final = """
SELECT
    crashes.kind,
    count(*) FILTER (final_state NOT IN ('pending', 'failed')),
    count(*) FILTER (stage_reached != 'raw_report' AND final_state NOT IN ('pending', 'failed')
        AND NOT (final_state = 'rejected' AND stage_reached = 'crash_record')),
    count(*) FILTER (reason = 'no_map_coverage'),
    count(*) FILTER (reason IN (SELECT reason FROM stage_outcomes WHERE stage = 'road_map' AND outcome = 'rejected')),
    count(*) FILTER (final_state = 'verified')
FROM crashes
WHERE crashes.kind IS NOT NULL AND cohort IN (SELECT unnest($cohorts))
GROUP BY crashes.kind
"""
_THIN: Final = """
SELECT count(*)
FROM crashes
WHERE
    stage_reached = 'crash_record' AND starts_with(reason, 'incomplete') AND cohort IN (SELECT unnest($cohorts))
    AND key IN (
        SELECT key FROM vehicles GROUP BY key
        HAVING count(crash_type_code) + count(critical_event_code)
            + count(movement_code) FILTER (NOT list_contains(implied, 'movement')) = 0
    )
"""


@dataclass(frozen=True)
class StoredKind:
    """The crashes of one kind that were worked on, and the number that passed each step."""

    registered: int = 0
    complete: int = 0
    with_map_at_hand: int = 0
    mapped: int = 0
    verified: int = 0


@dataclass(frozen=True)
class KindCoverage:
    """One kind: crashes in the national tables, stored crashes, and their success rate.

    The rate is None without stored crashes of a judged kind; such a kind counts as not covered.
    """

    kind: CrashKind
    national: int
    stored: StoredKind
    judged: bool
    verified_rate: float | None


@dataclass(frozen=True)
class NationalCoverage:
    """Shares of all crashes of the national tables (0 to 1), and their kinds.

    ``verified_bounds`` are 90 % bounds of ``verified``, from the number of stored crashes alone.
    """

    crashes: int
    kinds: tuple[KindCoverage, ...]
    two_vehicles: float
    judged: float
    verified: float
    verified_bounds: tuple[float, float]


def count_kinds(files: Iterable[Path]) -> Counter[CrashKind]:
    """Return the crashes of national ``accident`` tables by kind.

    A file is CSV, or a ZIP archive of one. Raises :class:`UserError` for files without such a table.
    """
    counted: Counter[tuple[int, int]] = Counter()
    for file in files:
        table = read_accidents(file, _COLUMNS)
        pairs = table.group_by(list(_COLUMNS)).aggregate([([], "count_all")]).to_pylist()
        counted.update({(row["HARM_EV"], row["VE_FORMS"]): row["count_all"] for row in pairs})
    kinds: Counter[CrashKind] = Counter()
    for (harm_ev, vehicles), crashes in counted.items():
        kinds[kind_of_codes(harm_ev, vehicles, []) or CrashKind.OTHER] += crashes
    return kinds


def read_accidents(file: Path, columns: Sequence[str], where_there: Sequence[str] = ()) -> pa.Table:
    """Return whole-number columns of a national ``accident`` table; those in ``where_there`` only if it has them.

    A file is CSV, or a ZIP archive of one. Raises :class:`UserError` for a file without such a table.
    """
    expected = f"expected FARS's accident table, CSV with the columns {' and '.join(columns)}, or a ZIP archive of it"
    try:
        data = file.read_bytes()
        if zipfile.is_zipfile(io.BytesIO(data)):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                names = [name for name in archive.namelist() if Path(name).stem.lower() == "accident"]
                if not names:
                    raise UserError(f"{file}: no accident.csv among {', '.join(archive.namelist())}; {expected}")
                data = archive.read(names[0])
        table = csv.read_csv(pa.py_buffer(data), read_options=csv.ReadOptions(encoding="latin-1"))
        table = table.rename_columns([name.upper() for name in table.column_names])
        names = [*columns, *(name for name in where_there if name in table.column_names)]
        return table.select(names).cast(pa.schema([(name, pa.int64()) for name in names]))
    except (OSError, KeyError, pa.ArrowException, zipfile.BadZipFile) as error:
        raise UserError(f"{file}: {str(error).splitlines()[0]}; {expected}") from error


def thin_reports(warehouse: Path, cohorts: Sequence[str]) -> int:
    """Return the number of incomplete stored crashes whose vehicles have no movement in the registered tables.

    The movements are ``P_CRASH1``, ``P_CRASH2`` and ``ACC_TYPE``, which NHTSA's own tables have.
    """
    ((crashes,),) = _asked(warehouse, _THIN, cohorts)
    return int(crashes)


def count_stored_kinds(warehouse: Path, cohorts: Sequence[str]) -> dict[CrashKind, StoredKind]:
    """Count the outcomes of the stored crashes of some cohorts, by kind."""
    found = _asked(warehouse, _RATES, cohorts)
    return {
        CrashKind(kind): StoredKind(
            registered=registered,
            complete=complete,
            with_map_at_hand=complete - no_map,
            mapped=complete - no_map - bad_map,
            verified=verified,
        )
        for kind, registered, complete, no_map, bad_map, verified in found
    }


def _asked(warehouse: Path, sql: str, cohorts: Sequence[str]) -> list[tuple[Any, ...]]:
    with open_warehouse(warehouse) as connection:
        return connection.execute(sql, {"cohorts": list(cohorts)}).fetchall()


def coverage_of_country(national: Mapping[CrashKind, int], stored: Mapping[CrashKind, StoredKind]) -> NationalCoverage:
    """Return the shares of all crashes that are of judged kinds, and that would be verified with maps everywhere.

    The bounds (90 %) only cover sampling: of each step's rate after the crashes seen, with Jeffreys' prior.
    """
    total = sum(national.values())
    if not total:
        raise UserError("no crash in the national tables")
    kinds = tuple(
        KindCoverage(kind, count, stored.get(kind, StoredKind()), kind in JUDGED_KINDS, _rate(stored.get(kind)))
        for kind, count in sorted(national.items(), key=lambda pair: (-pair[1], pair[0]))
    )
    return NationalCoverage(
        crashes=total,
        kinds=kinds,
        two_vehicles=national.get(CrashKind.TWO_VEHICLES, 0) / total,
        judged=sum(each.national for each in kinds if each.judged) / total,
        verified=sum(each.national * (each.verified_rate or 0.0) for each in kinds if each.judged) / total,
        verified_bounds=_bounds(kinds, total),
    )


def _rate(stored: StoredKind | None) -> float | None:
    if stored is None or not stored.registered or not stored.with_map_at_hand:
        return None
    return stored.complete / stored.registered * stored.verified / stored.with_map_at_hand


def _bounds(kinds: Sequence[KindCoverage], total: int) -> tuple[float, float]:
    drawn = np.random.default_rng(1)
    covered = np.zeros(_DRAWS)
    for each in kinds:
        if each.judged and each.verified_rate is not None:
            stored = each.stored
            complete = drawn.beta(stored.complete + 0.5, stored.registered - stored.complete + 0.5, _DRAWS)
            verified = drawn.beta(stored.verified + 0.5, stored.with_map_at_hand - stored.verified + 0.5, _DRAWS)
            covered += each.national / total * complete * verified
    low, high = np.percentile(covered, _TAILS_PCT)
    return float(low), float(high)


# --- weights ---------------------------------------------------------------------------------------------------------
_LIGHT: Final = {1: "daylight", 2: "dark", 3: "dark", 6: "dark", 4: "twilight", 5: "twilight"}
_ROAD: Final = {
    1: "interstate",
    **dict.fromkeys((2, 3), "principal_arterial"),
    **dict.fromkeys((4, 5, 6), "minor_arterial_or_collector"),
    7: "local",
}
_CODES: Final = ("HARM_EV", "VE_FORMS", "TYP_INT", "LGT_COND")
_ROUNDS, _ENOUGH = 500, 1e-9

Margins = dict[str, dict[str, int]]


class CrashClasses(NamedTuple):
    """A crash's class in each margin; None where it is not known."""

    kind: str | None
    junction: str | None
    light: str | None
    road_class: str | None


def classes_of(row: Mapping[str, Any]) -> CrashClasses:
    """Return the classes of a row of the warehouse's ``crashes``.

    >>> row = {"kind": "pedestrian", "road_topology": "t", "light_code": 3, "function_class_code": 99}
    >>> classes_of(row)
    CrashClasses(kind='pedestrian', junction='intersection', light='dark', road_class=None)
    """
    junction = _junction(RoadTopology(row["road_topology"])) if row["road_topology"] else None
    light, road = _LIGHT.get(row["light_code"]), _ROAD.get(row["function_class_code"])
    return CrashClasses(row["kind"], junction, light, road)


def _junction(topology: RoadTopology) -> str | None:
    if topology is RoadTopology.OTHERS:
        return None
    return "none" if topology is RoadTopology.NOT_AN_INTERSECTION else "intersection"


def national_margins(files: Iterable[Path]) -> Margins:
    """Return the crashes of judged kinds of national ``accident`` tables by the classes of each margin."""
    counted: Counter[tuple[int, ...]] = Counter()
    for file in files:
        table = read_accidents(file, _CODES, ("FUNC_SYS", "ROAD_FNC"))
        older = "FUNC_SYS" not in table.column_names
        columns = [table[name].to_pylist() for name in (*_CODES, "ROAD_FNC" if older else "FUNC_SYS")]
        for *codes, road in zip(*columns, strict=True):
            counted[*codes, FUNC_SYS_OF_ROAD_FNC.get(road, 0) if older else road] += 1
    margins: dict[str, Counter[str]] = {name: Counter() for name in CrashClasses._fields}
    for (harm_ev, vehicles, typ_int, light, road), crashes in counted.items():
        kind = kind_of_codes(harm_ev, vehicles, []) or CrashKind.OTHER
        if kind not in JUDGED_KINDS:
            continue
        classes = CrashClasses(str(kind), _junction(road_topology(typ_int)), _LIGHT.get(light), _ROAD.get(road))
        for name, value in classes._asdict().items():
            if value is not None:
                margins[name][value] += crashes
    return {name: dict(sorted(counts.items())) for name, counts in margins.items()}


def rake(crashes: Sequence[CrashClasses], margins: Margins) -> FloatArray:
    """Return a weight for each crash, 1 in the mean.

    >>> at = [CrashClasses("parked", None, light, None) for light in ("dark", "dark", "daylight")]
    >>> rake(at, {"light": {"dark": 100, "daylight": 100, "twilight": 9}}).tolist()  # no crash in the twilight
    [0.75, 0.75, 1.5]
    """
    weights = np.ones(len(crashes))
    members = {
        name: {value: np.array([getattr(each, name) == value for each in crashes]) for value in counts}
        for name, counts in margins.items()
    }
    for _ in range(_ROUNDS):
        before = weights.copy()
        for name, counts in margins.items():
            there = {value: each for value, each in members[name].items() if each.any()}
            wanted = sum(counts[value] for value in there)
            known = sum(float(weights[each].sum()) for each in there.values())
            for value, each in there.items():
                weights[each] *= counts[value] / wanted * known / weights[each].sum()
        if np.abs(weights - before).max(initial=0.0) < _ENOUGH:
            break
    return weights / weights.mean() if len(weights) else weights
