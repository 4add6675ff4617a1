"""Reported directions of travel hidden from the estimate: how many approaches does it find by itself?

FARS has no directions, so only registers show how often an estimate comes from the right side. A register that has them
does: each crash is estimated without them and all that they imply, and again with them. Belongs here: which crashes are
asked, and what right means. Nothing is simulated; the maps of the cohort are used as they are stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.common.errors import Failure, Rejection, UserError
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.units import wrap_angle
from trace_dag.crash.completed_record import drop_headings
from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.record import CrashRecord, Moment, VehicleRecord
from trace_dag.flow.artefacts import MAP_REPORT, RECORD, ROAD_MAP
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.stored_crashes import crash_files, draw_sample
from trace_dag.flow.workspace import Workspace
from trace_dag.reconstruction.alternatives import bearing_from_rad
from trace_dag.simulation.states import Hypothesis, ParticipantState, StateEstimate

WITHIN_RAD: Final = math.radians(45)
"""Largest difference of a direction from the reported octant's: as the verdict's criterion."""


@dataclass(frozen=True)
class DirectionRow:
    """One crash. ``fits``: whether the reported directions go with the manner of collision. The other fields are of the
    estimate without the directions, and of that with them (``told_``): whether every vehicle of the best hypothesis is
    headed as reported before its turn, or after it if the report may mean that; the same for any kept hypothesis; and
    the likelihood of all hypotheses but the best. None without an estimate."""

    key: str
    manner: str
    junction: bool
    turns: bool
    fits: bool
    chance: float
    right_before: bool | None = None
    right: bool | None = None
    any_right: bool | None = None
    ambiguity: float | None = None
    told_right: bool | None = None


@dataclass(frozen=True)
class _Task:
    crash: CrashFiles


def hidden_directions(
    workspace: Workspace, cohort: str, *, most: int, seed: int, on_progress: OnProgress = silent
) -> list[DirectionRow]:
    """Return the crashes of two vehicles with a map whose directions are both reported; of more than ``most`` so many
    drawn.

    Raises :class:`UserError` where a cohort has none.
    """
    asked = [
        each
        for each in crash_files(workspace, workspace.registry.keys(cohort))
        if each.has(RECORD) and each.has(ROAD_MAP) and _both_headed(each.load(RECORD))
    ]
    if not asked:
        raise UserError(
            f"cohort {cohort!r} has no mapped crash of two vehicles with both directions reported; "
            f"trace-dag run --cohort {cohort} makes the maps, and FARS has no directions"
        )
    tasks = [_Task(each.unread()) for each in draw_sample(asked, most, seed)]
    rows: list[DirectionRow] = []
    on_progress(0, len(tasks))
    with workspace.executing() as executor:
        for task, row in run_redoing_lost(executor, _compared, tasks, lambda task: [task]):
            if isinstance(row, Lost):
                raise Failure(f"{task.crash.key}: its worker died ({row.detail})")
            rows.append(row)
            on_progress(len(rows), len(tasks))
    return sorted(rows, key=lambda row: row.key)


def _both_headed(record: CrashRecord) -> bool:
    pair = record.colliding_vehicles
    return record.moving_vehicles == 2 and pair is not None and all(each.heading is not None for each in pair)


def _compared(task: _Task) -> DirectionRow:
    crash = task.crash
    record = crash.load(RECORD)
    pair = record.colliding_vehicles
    assert pair is not None
    row = DirectionRow(
        record.key,
        record.collision_type.value,
        record.junction_relation_code in _AT_JUNCTIONS,
        any(turn_of(vehicle) is not None for vehicle in pair),
        directions_fit(record, pair),
        0.0,
    )
    hidden, told = _estimate(crash, drop_headings(record)), _estimate(crash, record)
    if told is not None:
        row = replace(row, told_right=headed_as_reported(told.best, pair))
    if hidden is None:
        return row
    kept = hidden.hypotheses
    return replace(
        row,
        chance=sum(headed_as_reported(each, pair) for each in kept) / len(kept),
        right_before=headed_as_reported(hidden.best, pair, before=True),
        right=headed_as_reported(hidden.best, pair),
        any_right=any(headed_as_reported(each, pair) for each in kept),
        ambiguity=hidden.ambiguity,
    )


_AT_JUNCTIONS: Final = frozenset({2, 3})  # RELJCT2


def _estimate(crash: CrashFiles, record: CrashRecord) -> StateEstimate | None:
    try:
        estimator = crash.services.estimator(crash.settings.states)
        return estimator.estimate(record, crash.load(ROAD_MAP), crash.load(MAP_REPORT))
    except Rejection:
        return None


def headed_as_reported(hypothesis: Hypothesis, pair: Iterable[VehicleRecord], *, before: bool = False) -> bool:
    """Return whether every vehicle of a pair is headed as reported; ``before``: before its turn, whatever the report
    means.

    A vehicle that stood is headed as its body is.
    """
    states = {state.vehicle_number: state for state in hypothesis.participants}
    return all(_is_headed(states[vehicle.number], vehicle, before=before) for vehicle in pair)


def _is_headed(state: ParticipantState, vehicle: VehicleRecord, *, before: bool) -> bool:
    assert vehicle.heading is not None
    bearing = bearing_from_rad(state)
    ways = [state.initial_pose.heading_rad if bearing is None else bearing + math.pi]
    if not before and vehicle.heading.moment is not Moment.BEFORE:
        ways.append(float(state.trajectory.heading_rad[-1]))
    return any(abs(wrap_angle(way - vehicle.heading.octant.heading_rad)) <= WITHIN_RAD + 1e-9 for way in ways)


def directions_fit(record: CrashRecord, pair: Sequence[VehicleRecord]) -> bool:
    """Return whether two reported directions go with the manner of collision: one way in a rear end, against each other
    head-on, across at an angle of two that went straight.

    Directions that a turn leaves open fit."""
    one, two = pair
    assert one.heading is not None
    assert two.heading is not None
    if turn_of(one) is not None or turn_of(two) is not None:
        return True
    apart = abs(wrap_angle(one.heading.octant.heading_rad - two.heading.octant.heading_rad))
    low, high = _APART_DEG.get(record.collision_type.value, (0.0, 180.0))
    return math.radians(low) - 1e-9 <= apart <= math.radians(high) + 1e-9


_APART_DEG: Final = {
    "front_to_rear": (0.0, 45.0),
    "front_to_front": (135.0, 180.0),
    "sideswipe_same_direction": (0.0, 45.0),
    "sideswipe_opposite_direction": (135.0, 180.0),
    "angle": (45.0, 135.0),
}


def summary(rows: Sequence[DirectionRow]) -> list[dict[str, object]]:
    """Return shares by manner of collision and kind of junction, then of all, then of those whose directions fit.

    ``chance`` is the share of kept hypotheses that are right: what a draw among them would find.
    """
    groups: dict[str, list[DirectionRow]] = {}
    for row in rows:
        groups.setdefault(f"{row.manner}, {'junction' if row.junction else 'elsewhere'}", []).append(row)
    groups = dict(sorted(groups.items()))
    groups["vehicles that turn"] = [row for row in rows if row.turns]
    groups["directions that fit their manner"] = [row for row in rows if row.fits]
    groups["all"] = list(rows)
    return [_shares(name, group) for name, group in groups.items() if group]


def calibration(rows: Sequence[DirectionRow]) -> list[dict[str, object]]:
    """Count how often the best hypothesis is right, beside the estimate's certainty of it (1 less its ambiguity)."""
    found: list[dict[str, object]] = []
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        within = [
            row
            for row in rows
            if row.ambiguity is not None and row.fits and low <= min(1 - row.ambiguity, 0.999) < low + 0.2
        ]
        if within:
            sure = sum(1 - (row.ambiguity or 0.0) for row in within) / len(within)
            found.append(
                {"sure": f"{low:.0%} to {low + 0.2:.0%}", "crashes": len(within), "mean": f"{sure:.0%}"}
                | {"right": _share(row.right for row in within)}
            )
    return found


def _shares(name: str, rows: Sequence[DirectionRow]) -> dict[str, object]:
    estimated = [row for row in rows if row.right is not None]
    return {
        "crashes": name,
        "asked": len(rows),
        "estimated": len(estimated),
        "right": _share(row.right for row in estimated),
        "before_turn": _share(row.right_before for row in estimated),
        "among_kept": _share(row.any_right for row in estimated),
        "chance": f"{sum(row.chance for row in estimated) / len(estimated):.0%}" if estimated else "",
        "told": _share(row.told_right for row in rows if row.told_right is not None),
    }


def _share(found: Iterable[bool | None]) -> str:
    values = [bool(value) for value in found]
    return f"{sum(values) / len(values):.0%}" if values else ""
