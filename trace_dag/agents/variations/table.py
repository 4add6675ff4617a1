"""A crash's family as a table: one row per variation."""

from __future__ import annotations

from typing import Any

from trace_dag.agents.variations.family import Variation
from trace_dag.common.schemas import Column, ColumnType, TableSchema

_TEXT, _INT, _REAL = ColumnType.TEXT, ColumnType.INTEGER, ColumnType.REAL

VARIATIONS = TableSchema(
    "variations",
    "Perturbed crashes that were kept as scenarios for tests",
    (
        Column("variation_id", _TEXT, "Key of the crash and number of the variation", required=True),
        Column("key", _TEXT, "Key of the crash", required=True),
        Column("number", _INT, "Number in the crash's family, from 1", required=True),
        Column("seed", _INT, "Seed of the family", required=True),
        Column("kind", _TEXT, "collision or near_miss", required=True),
        Column("gap_m", _REAL, "Least distance between the two bodies; 0 for a collision", unit="m", required=True),
        Column("impact_time_s", _REAL, "When the crash would have been", unit="s", required=True),
        Column("contact_shift_m", _REAL, "First contact from the crash's", unit="m"),
        Column("closing_speed_mps", _REAL, "Closing speed at the first contact", unit="mps"),
        Column("friction", _REAL, "Friction of tyres on the road", required=True),
        *(
            Column(f"{name}_{number}{unit and '_' + unit}", _REAL, f"{meaning} of the {place} vehicle", unit=unit)
            for number, place in ((1, "first"), (2, "second"))
            for name, unit, meaning in (
                ("speed_factor", "", "Speeds as a multiple of the recorded ones,"),
                ("delay", "s", "How much later it comes,"),
                ("offset_left", "m", "How far left of its recorded way it drives,"),
                ("reaction", "s", "Time before the recorded impact at which it brakes (0: never),"),
            )
        ),
        Column("code_version", _TEXT, "Code that made it", required=True),
        Column("verdict_fingerprint", _TEXT, "Of the crash it was made from", required=True),
    ),
)


def row(
    variation: Variation, recorded_xy_m: tuple[float, float], *, seed: int, code_version: str, verdict_fingerprint: str
) -> dict[str, Any]:
    """Return one variation as a row of :data:`VARIATIONS`.

    ``recorded_xy_m`` is the position of the crash's first contact.
    """
    contact = variation.case.contact
    x, y = recorded_xy_m
    shift_m = None if contact is None else ((contact.x_m - x) ** 2 + (contact.y_m - y) ** 2) ** 0.5
    changes: dict[str, Any] = {}
    for number, change in enumerate(variation.perturbation.vehicles[:2], start=1):
        changes[f"speed_factor_{number}"] = change.speed_factor
        changes[f"delay_{number}_s"] = change.delay_s
        changes[f"offset_left_{number}_m"] = change.offset_left_m
        changes[f"reaction_{number}_s"] = change.reaction_s
    return {
        "variation_id": variation.variation_id,
        "key": variation.case.key,
        "number": variation.number,
        "seed": seed,
        "kind": variation.kind.value,
        "gap_m": variation.gap_m,
        "impact_time_s": variation.case.impact_time_s,
        "contact_shift_m": shift_m,
        "closing_speed_mps": contact.closing_speed_mps if contact else None,
        "friction": variation.case.friction,
        **changes,
        "code_version": code_version,
        "verdict_fingerprint": verdict_fingerprint,
    }
