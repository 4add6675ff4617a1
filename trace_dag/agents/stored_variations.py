"""Families of variations as they are stored, read back as scenarios like the crashes.

``ROOT/variations/<key>.family.parquet`` lists a crash's family; each variation ``<key>-v001`` has, in the formats of
the crash's own artefacts, ``.estimate.json`` (the plan), ``.steps.parquet`` and ``.log.json`` (the simulation), and
``.json`` (what was changed and how it was made).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

from trace_dag.agents.evaluation.table import Row, rows_from_parquet
from trace_dag.agents.variations import Bounds, Criteria, Perturbation, Variation, VariationKind
from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import DamagedFile
from trace_dag.common.provenance import crash_of
from trace_dag.common.schemas import TableSchema
from trace_dag.common.storage.files import Storage
from trace_dag.flow.manifests import read_listed, sound_manifest
from trace_dag.flow.records import OnProblem, raise_problem
from trace_dag.simulation.log_io import logs_from_files
from trace_dag.simulation.states import StateEstimate, estimate_from_json
from trace_dag.simulation.types import SimulationLog

FOLDER = "variations"
VARIATIONS = TableSchema.of_csv(
    "trace_dag.agents", "variations", "Perturbed crashes that were kept as scenarios for tests"
)


@dataclass(frozen=True)
class FamilyRequest:
    """The request for a family: members, seed, bounds of the changes, and criteria to meet."""

    count: int = 10
    seed: int = 1
    bounds: Bounds = field(default_factory=Bounds)
    criteria: Criteria = field(default_factory=Criteria)


@dataclass(frozen=True)
class AboutVariation:
    """The description of a variation, beside its plan and log."""

    variation_id: str
    key: str
    number: int
    kind: VariationKind
    gap_m: float
    friction: float
    perturbation: Perturbation
    request: FamilyRequest
    code_version: str
    verdict_fingerprint: str


@dataclass(frozen=True, eq=False)
class StoredVariation:
    """A variation as read: a scenario in the terms of any crash."""

    about: AboutVariation
    estimate: StateEstimate
    log: SimulationLog


def read_variation(storage: Storage, name: str) -> StoredVariation:
    """Return a stored variation by its id.

    Raises :class:`DamagedFile` if its files differ from its manifest.
    """
    key = name.rpartition("-")[0]

    def read(extension: str) -> bytes:
        return _read(storage, key, f"{FOLDER}/{name}.{extension}")

    about = json_adapter(AboutVariation).validate_json(read("json"))
    estimate = estimate_from_json(read("estimate.json"), name=name)
    (log,) = logs_from_files(read("steps.parquet"), read("log.json"))
    return StoredVariation(about, estimate, log)


def all_rows(storage: Storage, *, on_problem: OnProblem = raise_problem) -> list[Row]:
    """Return all stored variations as rows.

    ``on_problem`` is called with the error of each damaged family.
    """
    return [each for rows in families(storage, on_problem).values() for each in rows]


def families(storage: Storage, on_problem: OnProblem, keys: Collection[str] | None = None) -> dict[str, list[Row]]:
    """Return the stored lists of families by key, of some crashes or of all."""
    there = {*sound_manifest(storage, FOLDER).files, *storage.list(FOLDER)}
    listed = {crash_of(name) for name in there if name.endswith(".family.parquet")}
    found = {}
    for key in sorted(listed if keys is None else listed & set(keys)):
        try:
            found[key] = rows_from_parquet(_read(storage, key, family_name(key)))
        except DamagedFile as damaged:
            on_problem(damaged)
    return found


def _read(storage: Storage, key: str, name: str) -> bytes:
    return read_listed(storage, name, remedy=f"trace-dag vary --only {key} makes the crash's variations again")


def family_name(key: str) -> str:
    """Return the path below the root of the list of a crash's family."""
    return f"{FOLDER}/{key}.family.parquet"


# --- the table of variations -----------------------------------------------------------------------------------------
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
