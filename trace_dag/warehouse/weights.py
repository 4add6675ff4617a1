"""Weights that make the crashes of a benchmark represent a country's: raking to margins of its national tables.

Deming and Stephan (Annals of Mathematical Statistics 11, 1940): weights are scaled so that the shares of each margin in
turn equal the country's, until all do. Margins are the kind of crash, the junction, the light and the class of the
road. A crash of unknown class keeps its weight in that margin. A class of the country without any crash is left out,
and the weights represent the rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.crash.classes import JUDGED_KINDS, CrashKind, RoadTopology, kind_of_codes, road_topology
from trace_dag.crash.codes.crash import FUNC_SYS_OF_ROAD_FNC
from trace_dag.warehouse.national import read_accidents

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
