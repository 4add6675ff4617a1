"""Whether a stored result is what would be made now.

Belongs here: what results are made from (:class:`Recipe`), what a stored one says of that (:class:`StoredResult`), and
which result of a crash is out of date. A stored result is compared in two steps: first its inputs and files, crash by
crash, then code, settings and libraries, which many results have in common. What the first step finds can be kept, so
that a change of the code costs the second step alone. Does not belong here: what to do about it
(:mod:`trace_dag.flow.batch`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from trace_dag.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.stage import Stage

if TYPE_CHECKING:
    from trace_dag.cohorts.registry import CrashSource


@dataclass(frozen=True)
class Recipe:
    """What a stage's results are made from that is the same for all crashes, and what else enters.

    ``sources`` are "report" and "maps"; ``artefacts`` those of earlier stages, each with its stage and extension.
    """

    code: str
    settings: dict[str, Any]
    libraries: dict[str, str]
    sources: frozenset[str]
    artefacts: tuple[tuple[Stage, str], ...]


def made_from(recipe: Recipe, source: CrashSource, records: Mapping[Stage, OutcomeRecord]) -> Provenance:
    """What the result of a stage would be made from now, of a crash with that source and those records."""
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


def is_current(record: OutcomeRecord | None, made_from: Provenance, whole: Mapping[str, bool]) -> bool:
    """Whether a stored outcome still holds: no failure, made from what it would be made from now, its artefacts whole.

    ``whole`` says of records by name whether their artefacts are, as :func:`trace_dag.flow.records.intact` finds.
    """
    if record is None or not _is_final(record):
        return False
    return whole.get(record.name, True) and record.fingerprint == made_from.fingerprint


def _is_final(record: OutcomeRecord) -> bool:
    return record.outcome in (Outcome.ACCEPTED, Outcome.REJECTED) and record.failed_attempt is None


@dataclass(frozen=True)
class StoredResult:
    """What a stored result says of its age; the same for all crashes with the same past.

    ``made_from`` is what it was made from: of the inputs only those that are others now, each with no digest.
    ``final``: no later attempt to make it anew has failed. ``whole``: its artefacts are there as they were stored.
    """

    stage: Stage
    made_from: Provenance
    accepted: bool
    final: bool
    whole: bool


def stored_results(
    records: Mapping[Stage, OutcomeRecord],
    recipes: Mapping[Stage, Recipe],
    source: CrashSource,
    whole: Mapping[str, bool],
) -> tuple[StoredResult, ...]:
    """The results of a crash in the order of ``recipes``, up to the first that did not accept it or is missing.

    Code, settings and libraries of the recipes do not count here, but in :func:`first_outdated`. ``whole`` as in
    :func:`is_current`.
    """
    found: list[StoredResult] = []
    for stage, recipe in recipes.items():
        record = records.get(stage)
        if record is None:
            break
        made, now = record.provenance, made_from(recipe, source, records).inputs
        found.append(
            StoredResult(
                stage,
                Provenance(made.code, made.settings, _others(made.inputs, now), made.libraries),
                accepted=record.outcome is Outcome.ACCEPTED,
                final=_is_final(record),
                whole=whole.get(record.name, True) and record.fingerprint == made.fingerprint,
            )
        )
        if not found[-1].accepted:
            break
    return tuple(found)


def _others(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    return {} if before == now else {name: "" for name in before.keys() | now if before.get(name) != now.get(name)}


def first_outdated(
    results: Iterable[StoredResult], recipes: Mapping[Stage, Recipe]
) -> tuple[Stage, tuple[str, ...]] | None:
    """The first result of a crash that a run would make again, and what has changed since, such as "code" or
    "setting radius_m"; the later ones depend on it. None where a run would make none again, or was to and failed.
    """
    for result in results:
        recipe = recipes[result.stage]
        now = Provenance(recipe.code, recipe.settings, {}, recipe.libraries)
        if not result.final:
            return None
        if not result.whole or result.made_from.fingerprint != now.fingerprint:
            return result.stage, result.made_from.changed_to(now) or ("files",)
        if not result.accepted:
            return None
    return None
