"""Fit the distributions of speeds that nobody reported, and write the table that the program uses.

    python -m lab fit_speeds --fars DIR ... --recorders cases.json [--reports DIR ...]

``--fars`` are folders of FARS national CSV files, ``--reports`` folders of reports in CrashAPI XML, ``--recorders`` a
file of NHTSA CIREN cases (as for ``python -m lab validate_simulator``). Written is
``trace_dag/reconstruction/motion/speed_coefficients.py``.

Travel speeds: the difference between the reported speed and the program's rule (limit, manoeuvre, class of the road)
is explained by features of the report, by least absolute deviations with a ridge: few rows must not make a large
shift. The residuals are kept as quantiles for each class of vehicles. Braking: the last known speed before the
impact as a share of the first one that was recorded three to six seconds before; quantiles by role, those of small
groups drawn to all."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from trace_dag.common.errors import Rejection
from trace_dag.common.geometry import FloatArray
from trace_dag.common.settings import CrashSettings
from trace_dag.common.units import kmh_to_mps, mps_to_mph
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.crash.crash_types import Relation, crash_type_of
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord, VehicleClass, VehicleRecord
from trace_dag.reconstruction.motion.speed_prior import Role, SpeedClass, features, role, speed_class
from trace_dag.reconstruction.motion.speeds import TravelSpeed, travel_speed
from trace_dag.reconstruction.pre_crash_scenarios import Party, party

TABLE: Final = Path(__file__).parents[1] / "trace_dag/reconstruction/motion/speed_coefficients.py"
LEVELS: Final = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
RIDGE: Final = 0.3
"""Penalty of the table's shifts: by cross validation 0.1 to 1 differ by 2 % in the mean error."""
POOLED: Final = 8.0
"""So many of all vehicles join those of a role."""
_AS_IF_MPH: Final = 0.5  # absolute deviations are smooth below
_TURNS: Final = 60
_FIRST_S, _LAST_S = (-6.0, -3.0), -1.0
_LEAST_MPS: Final = kmh_to_mps(15.0)
_STANDS_MPS: Final = 0.5
_NOTHING: Final = CrashRecord(
    "", 0, 0, 0.0, 0.0, (), (), CollisionType.OTHERS, RoadTopology.OTHERS, VehicleTrajectory.OTHERS
)


@dataclass(frozen=True)
class Reported:
    """A vehicle with a reported travel speed, and everything as if it were not reported."""

    party: Party
    rule: TravelSpeed
    speed_mps: float


@dataclass(frozen=True)
class Recorded:
    """A vehicle whose recorder has speeds before the impact: the first and the last of them."""

    case: str
    vehicle: VehicleRecord
    travel_mps: float
    impact_mps: float


def read_reports(fars: Sequence[Path], reports: Sequence[Path]) -> list[CrashRecord]:
    """Return all reports that can be read."""
    found = []
    sources: list[Iterable[tuple[str, bytes]]] = [FarsCsvSource.open(folder).reports() for folder in fars]
    sources += [((path.name, path.read_bytes()) for path in sorted(folder.glob("*.xml"))) for folder in reports]
    for source in sources:
        for name, data in source:
            try:
                found.append(read_report(data, name=name, settings=CrashSettings()))
            except Rejection as rejection:
                print(f"left out: {rejection}")
    return found


def masked(records: Iterable[CrashRecord]) -> Iterator[Reported]:
    """Yield every vehicle with a reported speed, hidden from everything that is asked about it."""
    for record in records:
        hidden = [replace(vehicle, travel_speed_mps=None) for vehicle in record.vehicles]
        crossing = any(crash_type_of(vehicle).relation is Relation.CROSSING for vehicle in hidden)
        for vehicle, without in zip(record.vehicles, hidden, strict=True):
            if vehicle.travel_speed_mps is None or not vehicle.in_transport:
                continue
            own = party(record, without)
            rule = travel_speed(without, own.crash_type, own.turn, None, crossing=crossing)
            yield Reported(own, rule, vehicle.travel_speed_mps)


def recorded_speeds(path: Path) -> list[Recorded]:
    """Return the first recording of each vehicle that reaches from three seconds before the impact to one."""
    found = []
    for case in json.loads(path.read_text()):
        for values in case["V"].values():
            samples = _samples(values)
            if not samples or not _FIRST_S[0] <= samples[0][0] <= _FIRST_S[1] or samples[-1][0] < _LAST_S:
                continue
            found.append(
                Recorded(str(case["ciren"]), _vehicle(values), kmh_to_mps(samples[0][1]), kmh_to_mps(samples[-1][1]))
            )
    return found


def _samples(values: dict[str, Any]) -> list[tuple[float, float]]:
    speeds = values.get("sp") or {}
    recordings = sorted(values.get("edr") or [], key=lambda each: each.get("cdcev") or math.inf)
    for recording in recordings:
        samples = speeds.get(str(recording.get("no"))) or []
        known = sorted((t, v) for t, v in samples if t is not None and v is not None and -6.0 <= t <= 0.5 and v < 300)
        if len(known) > 2:
            return known
    return []


def _vehicle(values: dict[str, Any]) -> VehicleRecord:
    """Return the speeds of a vehicle as a report would have them."""
    limit, surface = values.get("sl"), values.get("surf")
    return VehicleRecord(
        1, VehicleClass.CAR, 4.8, 1.8, 1.5, 1600.0,
        speed_limit_mps=kmh_to_mps(limit) if limit and limit < 200 else None,
        surface_condition_code=surface if surface in range(1, 12) else None,
        crash_type_code=values.get("crashtype") if values.get("crashtype") in range(100) else None,
    )  # fmt: skip


def fit_shifts(rows: Sequence[Reported]) -> dict[str, float]:
    """Return the shift of each feature to the rule, mph."""
    names = list(features(rows[0].party, rows[0].rule))
    x = np.array([[float(holds) for holds in features(each.party, each.rule).values()] for each in rows])
    y = np.array([mps_to_mph(each.speed_mps - each.rule.speed_mps) for each in rows])
    shifts: FloatArray = np.zeros(len(names))
    ridge = np.diag(np.full(len(names), RIDGE))
    for _ in range(_TURNS):
        weights = 1.0 / np.maximum(np.abs(y - x @ shifts), _AS_IF_MPH)
        weighted = x * weights[:, None]
        shifts = np.linalg.solve(weighted.T @ x + ridge, weighted.T @ y)
    return {name: round(float(value), 2) for name, value in zip(names, shifts, strict=True)}


def fit_spread(rows: Sequence[Reported], shifts: dict[str, float]) -> dict[str, tuple[float, ...]]:
    """Return the residuals by class of vehicles, mph, at the levels."""
    left: dict[str, list[float]] = {each.value: [] for each in SpeedClass}
    for row in rows:
        shift = sum(shifts[name] for name, holds in features(row.party, row.rule).items() if holds)
        left[speed_class(row.party, row.rule)].append(mps_to_mph(row.speed_mps - row.rule.speed_mps) - shift)
    return {name: _at_levels(values or [0.0]) for name, values in left.items()}


def fit_braking(rows: Sequence[Recorded]) -> dict[str, tuple[float, ...]]:
    """Return the share of its speed that a vehicle kept until the impact, by role, at the levels."""
    kept: dict[str, list[float]] = {each.value: [] for each in Role}
    for row in rows:
        if row.travel_mps >= _LEAST_MPS:
            share = min(max(row.impact_mps / row.travel_mps, 0.0), 1.3)
            kept[role(party_of(row.vehicle))].append(share)
    everybody = np.array([share for shares in kept.values() for share in shares])
    return {
        name: _weighted_levels(
            np.concatenate([np.array(shares), everybody]),
            np.concatenate([np.ones(len(shares)), np.full(len(everybody), POOLED / len(everybody))]),
        )
        for name, shares in kept.items()
    }


def party_of(vehicle: VehicleRecord) -> Party:
    """Return a vehicle of which only its own codes are known."""
    return party(_NOTHING, vehicle)


def _at_levels(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(float(value), 2) for value in np.quantile(values, LEVELS))


def _weighted_levels(values: FloatArray, weights: FloatArray) -> tuple[float, ...]:
    order = np.argsort(values)
    reached = (np.cumsum(weights[order]) - 0.5 * weights[order]) / weights.sum()
    return tuple(round(float(value), 3) for value in np.interp(LEVELS, reached, values[order]))


def write_table(rows: Sequence[Reported], recorded: Sequence[Recorded]) -> None:
    """Write the table as Python."""
    shifts = fit_shifts(rows)
    spread, braking = fit_spread(rows, shifts), fit_braking(recorded)
    years, crashes = sorted({row.party.record.case_year for row in rows}), len({row.party.record.key for row in rows})
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    lines = [
        '"""Distributions of speeds that nobody reported, read by :mod:`trace_dag.reconstruction.motion.speed_prior`.',
        "",
        f"Written by ``lab/fit_speeds.py`` on {today}, fitted to {len(rows)} travel speeds that reports",
        f"of FARS have ({years[0]} to {years[-1]}, {crashes} crashes) and to {len(recorded)} event data recorders of",
        "NHTSA CIREN (2017 to 2025).",
        "Mph and shares of a speed. A module and no file beside, so that an estimate's fingerprint covers it.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from collections.abc import Mapping",
        "from typing import Final",
        "",
        f"LEVELS: Final = {LEVELS!r}",
        '"""Probabilities of the columns below."""',
        "",
        "SHIFTS_MPH: Final[Mapping[str, float]] = {",
        *(f'    "{name}": {value!r},' for name, value in shifts.items()),
        "}",
        '"""What each feature of a report adds to the rule."""',
        "",
        "SPREAD_MPH: Final[Mapping[str, tuple[float, ...]]] = {",
        *(f'    "{name}": {values!r},' for name, values in spread.items()),
        "}",
        '"""What is left, by class of vehicles."""',
        "",
        "BRAKING: Final[Mapping[str, tuple[float, ...]]] = {",
        *(f'    "{name}": {values!r},' for name, values in braking.items()),
        "}",
        '"""Speed at the impact as a share of the one before, by role."""',
    ]
    by_hand = TABLE.read_text()  # decelerations and limits
    TABLE.write_text("\n".join(lines) + "\n\n" + by_hand[by_hand.index("BRAKING_G: Final") :])


def asked_speeds(about: str) -> tuple[list[Reported], list[Recorded]]:
    """Return the reported and the recorded speeds of the files that the command line names; ``about`` is for its
    help."""
    arguments = argparse.ArgumentParser(description=about.splitlines()[0])
    arguments.add_argument("--fars", type=Path, nargs="*", default=[], help="folders of FARS national CSV files")
    arguments.add_argument("--reports", type=Path, nargs="*", default=[], help="folders of reports as XML")
    arguments.add_argument("--recorders", type=Path, required=True, help="a file of NHTSA CIREN cases")
    options = arguments.parse_args()
    return list(masked(read_reports(options.fars, options.reports))), recorded_speeds(options.recorders)


def main() -> None:
    """Write the table."""
    rows, recorded = asked_speeds(__doc__)
    write_table(rows, recorded)
    print(f"{len(rows)} reported speeds and {len(recorded)} recorders: {TABLE}")


if __name__ == "__main__":
    main()
