"""Summary of the comparisons: median and worst error by kind of crash, the simulator's beside the peer's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

from lab.validation.rows import Compared

DIRECTION_WITHIN_DEG: Final = 20.0
_GROUPS: Final[Sequence[tuple[str, Callable[[Compared], bool]]]] = (
    ("both recorded, first vehicle", lambda row: row.kind == "both" and row.first),
    ("both recorded, second vehicle", lambda row: row.kind == "both" and not row.first),
    ("one recorded, the other's speed fitted", lambda row: row.kind == "one"),
    ("into a tree or pole", lambda row: row.kind == "object"),
)


@dataclass(frozen=True)
class GroupErrors:
    """A group of vehicles; errors of delta-v and crush are shares of the measured one. None where nothing is known."""

    group: str
    vehicles: int
    median_error: float | None
    leaning: float | None  # median with its sign: above 0 too much is simulated
    worst_error: float | None
    plastic_median_error: float | None
    plastic_worst_error: float | None
    direction_share: float | None  # within DIRECTION_WITHIN_DEG
    crush_vehicles: int
    crush_median_error: float | None
    pulse_median_s: float | None


def errors_by_group(rows: Iterable[Compared]) -> list[GroupErrors]:
    """Return the groups in their order, those without vehicles too."""
    compared = [row for row in rows if row.reason is None]
    return [_group(name, [row for row in compared if belongs(row)]) for name, belongs in _GROUPS]


def _group(name: str, rows: list[Compared]) -> GroupErrors:
    signed = _errors((row.simulated_delta_v_kmh, row.measured_delta_v_kmh) for row in rows)
    simulated = [abs(error) for error in signed]
    plastic = [abs(error) for error in _errors((row.plastic_delta_v_kmh, row.measured_delta_v_kmh) for row in rows)]
    crush = [abs(error) for error in _errors((row.simulated_crush_m, row.measured_crush_m) for row in rows)]
    turned = [
        abs(math.remainder(row.simulated_direction_deg - row.measured_direction_deg, 360.0))
        for row in rows
        if row.simulated_direction_deg is not None and row.measured_direction_deg is not None
    ]
    within = sum(angle <= DIRECTION_WITHIN_DEG for angle in turned)
    pulses = [row.pulse_s for row in rows if row.pulse_s is not None]
    return GroupErrors(
        group=name,
        vehicles=len(rows),
        median_error=median(simulated) if simulated else None,
        leaning=median(signed) if signed else None,
        worst_error=max(simulated, default=None),
        plastic_median_error=median(plastic) if plastic else None,
        plastic_worst_error=max(plastic, default=None),
        direction_share=within / len(turned) if turned else None,
        crush_vehicles=len(crush),
        crush_median_error=median(crush) if crush else None,
        pulse_median_s=median(pulses) if pulses else None,
    )


def _errors(pairs: Iterable[tuple[float | None, float | None]]) -> list[float]:
    return [found / measured - 1 for found, measured in pairs if found is not None and measured]
