"""Where each crash stands and whether a run would make it again, noted, so that a second look costs a listing.

A look lists the folders of the stages, and reads the records of those crashes alone that are listed otherwise than they
were at the look before. What it found is noted in ``cache/standing.json`` of the local folder. A note of a crash counts
as long as its report and maps are the same too. It says what the crash's results were made with, so that after a change
of the code or the settings only that is compared: a year has few such pasts, and each is looked at once. Nothing but
time depends on the note: without it everything is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from trace_dag.checksums import checked, with_checksum
from trace_dag.code_versions import code_version
from trace_dag.errors import DamagedFile, Failure
from trace_dag.flow.records import Records, intact, log_complaint, read_records
from trace_dag.flow.staleness import Recipe, StoredResult, first_outdated, stored_results
from trace_dag.flow.standing import Standing, standings
from trace_dag.garbage import no_garbage_collection
from trace_dag.provenance import crash_of
from trace_dag.stage import Stage
from trace_dag.storage import Storage

if TYPE_CHECKING:
    from trace_dag.cohorts.registry import CrashSource
    from trace_dag.flow.workspace import Workspace

_NOTE = "cache/standing.json"
_EVERYTHING = ("",)


@dataclass(frozen=True)
class StaleResult:
    """A stored result that a run would make again, and what has changed since, such as "code" or "setting radius_m"."""

    key: str
    stage: Stage
    changed: tuple[str, ...]


@dataclass(frozen=True)
class Look:
    """What was found of one crash."""

    standing: Standing
    stale: StaleResult | None


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
    recipes, sources = _recipes(workspace), workspace.registry.sources(keys)
    notes = Storage(workspace.storage.local_folder)
    now = listed(workspace.storage, _about(sources))
    before = _noted(notes, recipes)
    found = {key: seen for key in keys if (seen := before.get(key)) is not None and seen.listed == now[key]}
    changed = [key for key in keys if key not in found]
    damaged: set[str] = set()

    def complain(failure: Failure) -> None:
        log_complaint(failure)
        if isinstance(failure, DamagedFile):
            damaged.add(crash_of(failure.name))

    if changed:
        records = read_records(workspace.storage, changed, complain=complain)
        results = _results(workspace, records, recipes, sources)
        stand = standings(records)
        found |= {key: _Seen(now[key], stand[key], results[key]) for key in changed}
        _note(notes, recipes, {key: seen for key, seen in (before | found).items() if key not in damaged})
    stale = {each.key: each for each in _stale({key: seen.results for key, seen in found.items()}, recipes)}
    return {key: Look(found[key].standing, stale.get(key)) for key in keys}


def stale_results(workspace: Workspace, records: Mapping[str, Records]) -> list[StaleResult]:
    """The first result of each crash that is out of date, though nothing has failed; the later ones depend on it.

    ``records`` are those stored of some crashes. Results that were never made, or that a run tried to make again
    without success, are not listed.
    """
    recipes, sources = _recipes(workspace), workspace.registry.sources(records)
    return list(_stale(_results(workspace, records, recipes, sources), recipes))


_Results = tuple[StoredResult, ...]  # of a crash


@dataclass(frozen=True)
class _Seen:
    """What a look found of a crash: how its files are ``listed`` (a digest), where it stands, its results."""

    listed: str
    standing: Standing
    results: _Results


@dataclass(frozen=True)
class _SeenShort:
    """The same as it is noted, with the number of its results among all that differ."""

    listed: str
    standing: Standing
    results: int


@dataclass(frozen=True)
class _Note:
    """``made_by``: a digest of the code that finds what is noted, and of what enters the results of each stage."""

    made_by: str
    results: list[_Results]
    crashes: dict[str, _SeenShort]


def _recipes(workspace: Workspace) -> dict[Stage, Recipe]:
    flow, settings = workspace.flow, workspace.settings
    return flow.recipes(settings, flow.code_versions(settings))


def _results(
    workspace: Workspace,
    records: Mapping[str, Records],
    recipes: Mapping[Stage, Recipe],
    sources: Mapping[str, CrashSource],
) -> dict[str, _Results]:
    """The stored results of some crashes."""
    whole = intact(workspace.storage, [record for each in records.values() for record in each.values()])
    return _shared({key: stored_results(each, recipes, sources[key], whole) for key, each in records.items()})


def _shared(results: Mapping[str, _Results]) -> dict[str, _Results]:
    """The same, where equal results are one object."""
    by_id: dict[int, _Results] = {}
    alike: dict[object, list[_Results]] = {}
    for each in results.values():
        if id(each) in by_id:
            continue
        others = alike.setdefault(tuple((one.stage, one.whole, one.made_from.code) for one in each), [])
        same = next((other for other in others if other == each), None)
        if same is None:
            others.append(each)
        by_id[id(each)] = same or each
    return {key: by_id[id(each)] for key, each in results.items()}


def _stale(results: Mapping[str, _Results], recipes: Mapping[Stage, Recipe]) -> Iterator[StaleResult]:
    """Each of some crashes' first result that is out of date."""
    found: dict[int, tuple[Stage, tuple[str, ...]] | None] = {}
    for key, each in results.items():
        if id(each) not in found:
            found[id(each)] = first_outdated(each, recipes)
        if (outdated := found[id(each)]) is not None:
            yield StaleResult(key, *outdated)


def _about(sources: Mapping[str, CrashSource]) -> dict[str, str]:
    """What decides about a crash beside its stored files and what all crashes have in common: its report and maps."""
    return {
        key: f"{source.report.kind} {source.report.sha256} {source.report.location} {source.maps_digest}\n"
        for key, source in sources.items()
    }


def _made_by(recipes: Mapping[Stage, Recipe]) -> str:
    entering = [[stage, sorted(each.sources), each.artefacts] for stage, each in recipes.items()]
    text = json.dumps([code_version((__name__,)).digest, entering])
    return hashlib.sha256(text.encode()).hexdigest()


def _noted(notes: Storage, recipes: Mapping[Stage, Recipe]) -> dict[str, _Seen]:
    try:
        note = _notes().validate_python(checked(notes.read(_NOTE), name=_NOTE))
    except (FileNotFoundError, DamagedFile, ValidationError):
        return {}
    if note is None or note.made_by != _made_by(recipes):
        return {}
    return {key: _Seen(each.listed, each.standing, note.results[each.results]) for key, each in note.crashes.items()}


def _note(notes: Storage, recipes: Mapping[Stage, Recipe], crashes: Mapping[str, _Seen]) -> None:
    results = _shared({key: seen.results for key, seen in crashes.items()})
    distinct = list({id(each): each for each in results.values()}.values())
    number = {id(each): index for index, each in enumerate(distinct)}
    short = {key: _SeenShort(seen.listed, seen.standing, number[id(results[key])]) for key, seen in crashes.items()}
    try:
        notes.write(_NOTE, with_checksum(_notes().dump_json(_Note(_made_by(recipes), distinct, short))))
    except Failure as failure:  # a look is no less true where nothing can be written
        log_complaint(failure)


@cache
def _notes() -> TypeAdapter[_Note]:
    return TypeAdapter(_Note)
