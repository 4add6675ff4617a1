"""Where each crash stands and whether a run would make it again, noted, so that a second look costs a listing.

A look lists the folders of the stages, and reads the records of those crashes alone that are listed otherwise than they
were at the look before. What it found is noted in ``cache/standing.json`` of the local folder. A note counts as long as
the code, the settings, the report and the maps of the crash are the same too. Nothing but time depends on the note:
without it everything is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from pydantic import TypeAdapter, ValidationError

from trace_dag.code_versions import code_version
from trace_dag.errors import DamagedFile, Failure
from trace_dag.flow.batch import StaleResult, stale_results, work_of
from trace_dag.flow.records import log_complaint, read_records
from trace_dag.flow.standing import Standing, standings
from trace_dag.flow.workspace import Workspace
from trace_dag.garbage import no_garbage_collection
from trace_dag.provenance import crash_of
from trace_dag.sealing import is_sealed, sealed, unsealed
from trace_dag.stage import Stage
from trace_dag.storage import Storage

_NOTE = "cache/standing.json"
_EVERYTHING = ("",)


@dataclass(frozen=True)
class Look:
    """What was found of one crash; ``listed`` is a digest of what it was found from."""

    standing: Standing
    stale: StaleResult | None
    listed: str


@no_garbage_collection()
def listed(
    storage: Storage, about: Mapping[str, str], endings: Mapping[Stage, tuple[str, ...]] | None = None
) -> dict[str, str]:
    """For each crash a digest of how its stored files are listed, and of what else is said ``about`` it.

    ``endings``: of each stage only files whose name ends so; all of them by default.
    """
    lines = {key: [text] for key, text in about.items()}
    for stage in Stage:
        start = len(stage.value) + 1
        for name, entry in storage.list(stage.value, endings[stage] if endings else _EVERYTHING).items():
            if (of_crash := lines.get(name[start:].partition(".")[0])) is not None:
                of_crash.append(f"{name} {entry.size} {entry.version}\n")
    return {key: hashlib.sha256("".join(sorted(of_crash)).encode()).hexdigest() for key, of_crash in lines.items()}


@no_garbage_collection()
def look_at(workspace: Workspace, keys: Sequence[str]) -> dict[str, Look]:
    """Where some registered crashes stand, in the order of ``keys``, and what of each a run would make again."""
    notes = Storage(workspace.storage.local_folder)
    now = listed(workspace.storage, _about(workspace, keys))
    before = _noted(notes)
    found = {key: look for key in keys if (look := before.get(key)) is not None and look.listed == now[key]}
    changed = [key for key in keys if key not in found]
    damaged: set[str] = set()

    def complain(failure: Failure) -> None:
        log_complaint(failure)
        if isinstance(failure, DamagedFile):
            damaged.add(crash_of(failure.name))

    if changed:
        records = read_records(workspace.storage, changed, complain=complain)
        stale = {each.key: each for each in stale_results(workspace, records)}
        found |= {key: Look(each, stale.get(key), now[key]) for key, each in standings(records).items()}
        _note(notes, {key: look for key, look in (before | found).items() if key not in damaged})
    return {key: found[key] for key in keys}


def _about(workspace: Workspace, keys: Sequence[str]) -> dict[str, str]:
    """What decides about a crash beside its stored files: code, settings, report and maps."""
    recipes = work_of(workspace, "").recipes.items()
    made_by = [[stage, each.code, each.settings, each.libraries] for stage, each in recipes]
    same_for_all = json.dumps([code_version((__name__,)).digest, made_by], sort_keys=True)
    digest = hashlib.sha256(same_for_all.encode()).hexdigest()
    sources = workspace.registry.sources(keys)
    return {
        key: f"{digest} {source.report.kind} {source.report.sha256} {source.report.location} {source.maps_digest}\n"
        for key, source in sources.items()
    }


def _noted(notes: Storage) -> dict[str, Look]:
    try:
        data = notes.read(_NOTE)
        return _looks().validate_json(unsealed(data, name=_NOTE))["crashes"] if is_sealed(data) else {}
    except (FileNotFoundError, DamagedFile, ValidationError):
        return {}


def _note(notes: Storage, crashes: Mapping[str, Look]) -> None:
    try:
        notes.write(_NOTE, sealed(_looks().dump_json({"crashes": dict(crashes)})))
    except Failure as failure:  # a look is no less true where nothing can be written
        log_complaint(failure)


@cache
def _looks() -> TypeAdapter[dict[str, dict[str, Look]]]:
    return TypeAdapter(dict[str, dict[str, Look]])
