"""Staleness of stored results: the one decision that runs, ``status`` and ``verify`` share.

Belongs here: the inputs of results (:class:`Recipe`), and the reasons why a stored one is stale. Does not belong here:
running stale stages (:mod:`trace_dag.flow.batch`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.common.stage import Stage

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.registry import CrashSource

MISSING, FAILED, FILES = "never made", "failed", "files"
"""Reasons to run a stage beside what :meth:`trace_dag.common.provenance.Provenance.changed_to` names."""


@dataclass(frozen=True)
class Recipe:
    """The inputs of a stage that are the same for all crashes, and the names of its other inputs.

    ``sources`` are "report" and "maps"; ``artefacts`` those of earlier stages, each with its stage and extension.
    """

    code: str
    settings: dict[str, Any]
    libraries: dict[str, str]
    sources: frozenset[str]
    artefacts: tuple[tuple[Stage, str], ...]


def current_inputs(recipe: Recipe, source: CrashSource, records: Mapping[Stage, OutcomeRecord]) -> Provenance:
    """Return the present inputs of a stage for a crash with that source and those records."""
    inputs = {}
    if "report" in recipe.sources:
        report = source.report
        inputs["report"] = report.sha256 or f"{report.kind}:{report.location}"
    if "maps" in recipe.sources:
        inputs["maps"] = source.maps_digest
    for stage, extension in recipe.artefacts:
        record = records.get(stage)
        file = record.artefact(extension) if record else None
        inputs[f"{stage}.{extension}"] = file.sha256 if file else ""
    return Provenance(recipe.code, recipe.settings, inputs, recipe.libraries)


def why_to_run(record: OutcomeRecord | None, now: Provenance, whole: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the reasons to run a stage for a crash that reaches it; empty if its stored result is current.

    ``now`` has the present inputs. ``whole`` gives, by the record's name, whether artefacts are intact, as from
    :func:`trace_dag.flow.records.intact`; records without an entry count as intact.
    """
    if record is None or record.outcome is Outcome.STARTED:
        return (MISSING,)
    if record.outcome is Outcome.FAILED or record.failed_attempt is not None:
        return (FAILED,)
    if record.provenance != now:
        return record.provenance.changed_to(now)
    return () if record.fingerprint and whole.get(record.name, True) else (FILES,)
