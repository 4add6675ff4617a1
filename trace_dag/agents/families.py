"""Families of variations of stored crashes, made in parallel and kept under the root. A family is made as a whole.

Belongs here: which crashes, the workers, storage. Does not belong here: what a variation is
(:mod:`trace_dag.agents.variations`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from trace_dag.agents.evaluation.table import rows_to_parquet
from trace_dag.agents.stored_cases import StoredCase, load_case, report_each
from trace_dag.agents.stored_variations import FOLDER, VARIATIONS, AboutVariation, FamilyRequest, family_name, row
from trace_dag.agents.variations import Variation, VariationKind, family
from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.artefacts import ESTIMATE, VERDICT
from trace_dag.flow.manifests import list_files, sound_manifest
from trace_dag.flow.workspace import Workspace
from trace_dag.simulation.log_io import logs_to_files
from trace_dag.simulation.run import backend
from trace_dag.simulation.states import EstimatorRun, Hypothesis, ParticipantState, StateEstimate, estimate_to_json
from trace_dag.simulation.types import Participant

VERSION = "3"
"""Number of the code that makes variations; see :data:`trace_dag.flow.stages.VERSIONS`."""


@dataclass(frozen=True)
class FamilyReport:
    """The family of one crash: members kept and drawn, and the error if it broke."""

    key: str
    kept: int = 0
    near_misses: int = 0
    drawn: int = 0
    error: str = ""


def make_families(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    request: FamilyRequest,
    *,
    on_progress: Callable[[FamilyReport], None] = lambda _: None,
) -> list[FamilyReport]:
    """Make and store families of some verified crashes; return their reports in order.

    ``on_progress`` is called with each finished crash.
    """
    return report_each(workspace, cases, partial(_make_family, request), FamilyReport, on_progress)


def _make_family(request: FamilyRequest, stored: StoredCase) -> FamilyReport:
    files = stored.files.unread()
    storage, settings = files.storage, files.settings
    case = load_case(stored)
    contact = case.contact
    if contact is None:
        raise Failure(f"{stored.key}: its simulation has no contact; run it again")
    kept, drawn = family(
        case,
        backend(settings.sim),
        count=request.count,
        seed=request.seed,
        bounds=request.bounds,
        criteria=request.criteria,
    )
    recorded = files.load(ESTIMATE).hypotheses[files.load(VERDICT).hypothesis]
    before = sound_manifest(storage, FOLDER).beginning(f"{stored.key}.", f"{stored.key}-v")
    rows = []
    written: list[StoredFile] = []
    for variation in kept:
        written += _store(storage, variation, recorded, request, VERSION, stored.fingerprint)
        rows.append(
            row(
                variation,
                (contact.x_m, contact.y_m),
                seed=request.seed,
                code_version=VERSION,
                verdict_fingerprint=stored.fingerprint,
            )
        )
    written.append(storage.write(family_name(stored.key), rows_to_parquet(rows, VARIATIONS)))
    gone = before.keys() - {file.name for file in written}
    list_files(storage, FOLDER, written, gone)
    for name in gone:
        storage.delete(name)
    near_misses = sum(variation.kind is VariationKind.NEAR_MISS for variation in kept)
    return FamilyReport(stored.key, len(kept), near_misses, drawn)


def _store(
    storage: Storage, variation: Variation, recorded: Hypothesis, request: FamilyRequest, code: str, fingerprint: str
) -> list[StoredFile]:
    case, name = variation.case, f"{FOLDER}/{variation.variation_id}"
    about = AboutVariation(
        variation.variation_id,
        case.key,
        variation.number,
        variation.kind,
        variation.gap_m,
        case.friction,
        variation.perturbation,
        request,
        code,
        fingerprint,
    )
    estimate = StateEstimate(case.key, (_as_hypothesis(recorded, variation),), EstimatorRun("variation", "1"))
    steps, summary = logs_to_files([case.recorded])
    return [
        storage.write(f"{name}.estimate.json", estimate_to_json(estimate)),
        storage.write(f"{name}.steps.parquet", steps),
        storage.write(f"{name}.log.json", summary),
        storage.write(f"{name}.json", json_adapter(AboutVariation).dump_json(about, indent=1)),
    ]


def _as_hypothesis(recorded: Hypothesis, variation: Variation) -> Hypothesis:
    """Return the variation's plan in the terms of an estimate, without the planned place of the impact."""
    case, contact = variation.case, variation.case.contact
    by_number = {each.number: each for each in case.participants}
    return replace(
        recorded,
        name=f"{recorded.name}, {variation.variation_id}",
        participants=tuple(
            _as_state(state, by_number[state.vehicle_number], case.impact_time_s) for state in recorded.participants
        ),
        impact_time_s=case.impact_time_s,
        impact_point_xy_m=recorded.impact_point_xy_m if contact is None else (contact.x_m, contact.y_m),
        checks=(),
    )


def _as_state(state: ParticipantState, participant: Participant, impact_time_s: float) -> ParticipantState:
    t = participant.trajectory
    x, y, z, heading, speed = (
        float(np.interp(impact_time_s, t.time_s, values))
        for values in (t.x_m, t.y_m, t.z_m, np.unwrap(t.heading_rad), t.speed_mps)
    )
    return replace(
        state,
        initial_pose=participant.initial_pose,
        initial_speed_mps=participant.initial_speed_mps,
        trajectory=t,
        impact_pose=Pose(x, y, math.remainder(heading, math.tau), z),
        impact_speed_mps=speed,
        impact_clock_h=None,
    )
