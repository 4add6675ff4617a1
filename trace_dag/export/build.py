"""The benchmark: a scenario package for every accepted crash, and a static site about all crashes.

``ROOT/benchmark/index.html`` opens from a file. Below it: ``crashes/`` a page per crash, ``packages/`` the archives,
``thumbnails/`` moving pictures of accepted crashes, ``replays/`` the data that ``replay.html`` shows for every
simulated crash. Nothing is stored twice: pages link to the artefacts and pictures of the root. A crash whose artefacts,
outcome and code have not changed is not made again. Belongs here: pages, their verification and repair, and the layout
of the folder. Does not belong here: the other files of a crash (:mod:`trace_dag.export.crash_files`), and the contents
of packages and pages (:mod:`trace_dag.scenario`).
"""

from __future__ import annotations

import hashlib
import json
import math
import traceback
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trace_dag.agents.stored_traffic import read_traffic, traffic_files
from trace_dag.agents.summaries import write_leaderboard
from trace_dag.common.errors import DamagedFile, Failure
from trace_dag.common.gc_pause import gc_paused, import_frozen
from trace_dag.common.provenance import crash_of
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.export.crash_files import (
    FOLDER,
    FOLDERS_OF_CRASHES,
    MADE_WITH,
    REPLAYS,
    VERSION,
    made_of,
    make_files,
    package_name,
    page_name,
    read_notes,
    replay_name,
    thumbnail_name,
)
from trace_dag.export.packaging import map_attribution
from trace_dag.flow.artefacts import (
    ESTIMATE,
    LOGS,
    MAP_REPORT,
    RECORD,
    REJECTED_REPORT,
    SAMPLED,
    VERDICT,
    XODR,
    Artefact,
)
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import FinalState
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.manifests import (
    Manifest,
    manifest_name,
    not_as_listed,
    read_manifest,
    sound_manifest,
    write_manifest,
)
from trace_dag.flow.pool import Lost
from trace_dag.flow.records import Records, read_records
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.verify import Disagreement, DisagreementKind, Quarantine
from trace_dag.flow.workspace import Workspace
from trace_dag.osm.types import Rights
from trace_dag.warehouse import query

_BY_CODE = "code"  # of all, beside what each crash's files were made of
INDEX = f"{FOLDER}/index.html"
LEADERBOARD = f"{FOLDER}/leaderboard.html"
PAGES_LATER = (
    "No pictures, packages and pages were made: there are more crashes than execution.pages_up_to says. "
    "trace-dag open and trace-dag release make them all; trace-dag open KEY, trace-dag replay and trace-dag export "
    "--only make those of single crashes."
)
# Of a crash without a package, as its page calls them.
_OFFERED: Mapping[str, Artefact[Any]] = {"map.xodr": XODR, "verdict.json": VERDICT}


def sketch_name(key: str) -> str:
    """Return the path below the root of the picture on a crash's page where the run has drawn none."""
    return f"{FOLDER}/crashes/{key}.svg"


@dataclass(frozen=True)
class BenchmarkReport:
    """The packages and pages present, those made now, and errors by crash."""

    packages: int
    pages: int
    made: int
    errors: Mapping[str, str]


@dataclass(frozen=True)
class _Crash:
    """A crash whose page is to be made; rows are those of the warehouse."""

    files: CrashFiles
    row: Mapping[str, Any]
    outcomes: tuple[Mapping[str, Any], ...]
    rights: Rights
    digest: str
    has_traffic: bool
    made: tuple[StoredFile, ...] | None  # beside its page, by a worker of a run; None where that is still to do

    @property
    def key(self) -> str:
        return self.files.key


def build_benchmark(workspace: Workspace, *, contents: bool = False) -> BenchmarkReport:
    """Bring packages and site up to date with the warehouse, and make damaged files again.

    Damage is found by size, with ``contents`` by SHA-256.
    """
    storage, warehouse = workspace.storage, workspace.warehouse
    *of_table, outcomes = query.rows_of(warehouse, (*_TABLE, "stage_outcomes"))
    table = _table(*of_table)
    crashes = _crashes(workspace, outcomes, table)
    accepted = {row["key"] for row in table if FinalState(row["final_state"]).accepted}
    before = sound_manifest(storage, FOLDER)
    listed = before.files.values()
    damaged = {crash_of(file.name) for file, _ in not_as_listed(storage, listed, contents=contents)}
    stale = [crash for crash in crashes if crash.key in damaged or before.made_of.get(crash.key) != crash.digest]
    errors: dict[str, str] = {}
    made: dict[str, StoredFile] = {}
    done = 0
    with workspace.executing() as executor:
        if any(crash.made is None and crash.files.has(LOGS) for crash in stale):
            executor.prepare(get_ready)
        tasks = _tasks(workspace, stale, executor.workers)
        for crashes_of_task, found in run_redoing_lost(executor, _make, tasks, lambda task: [(each,) for each in task]):
            if isinstance(found, Lost):
                errors.update({crash.key: found.detail for crash in crashes_of_task})
            else:
                files_made, errors_of_task = found
                errors.update(errors_of_task)
                made.update((file.name, file) for file in files_made)
            done += len(crashes_of_task)
            workspace.page_listener(done, len(stale))
    digests = {crash.key: crash.digest for crash in crashes if crash.key not in errors}
    kept = digests.keys() - {crash.key for crash in stale}
    left = {name: file for name, file in before.files.items() if crash_of(name) in kept | errors.keys()}
    files = left | made
    index = _write_index(storage, warehouse, table, {crash.key: crash.rights for crash in crashes}, files)
    for name in before.files.keys() - files.keys() - {file.name for file in index}:
        storage.delete(name)
    _remove_others(storage, {"packages": accepted, "thumbnails": accepted, REPLAYS: {crash.key for crash in crashes}})
    all_files = files | {file.name: file for file in index}
    write_manifest(storage, FOLDER, Manifest(all_files, digests | {_BY_CODE: VERSION}))
    packages = sum(name.endswith(".zip") for name in files)
    return BenchmarkReport(packages, len(crashes), len(stale), errors)


def build_page(workspace: Workspace, key: str) -> Mapping[str, str]:
    """Make the package and page of one crash, and return its error, if any.

    Other pages stay as they are; the index lists those that are there. A key that the warehouse lacks makes nothing.
    """
    storage, warehouse = workspace.storage, workspace.warehouse
    *of_table, outcomes = query.rows_of(warehouse, (*_TABLE, "stage_outcomes"))
    table, before = _table(*of_table), sound_manifest(storage, FOLDER)
    for crash in _crashes(workspace, outcomes, [row for row in table if row["key"] == key]):
        made, errors = _make((crash,))
        if errors:
            return errors
        others = {name: file for name, file in before.files.items() if crash_of(name) not in (None, key)}
        files = others | {file.name: file for file in made}
        listed = [row for row in table if page_name(row["key"]) in files]
        _publish_index(storage, warehouse, listed, Manifest(files, {**before.made_of, key: crash.digest}))
    return {}


_TABLE = ("judged_crashes", "vehicles")


def _table(table: list[dict[str, Any]], vehicles: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the warehouse's crashes, each with the grade of its verdict and the classes of its vehicles."""
    classes: defaultdict[str, set[str]] = defaultdict(set)
    for row in vehicles:
        classes[row["key"]].add(row["vehicle_class"])
    return [row | {"vehicle_classes": ", ".join(sorted(classes[row["key"]]))} for row in table]


def publish_leaderboard(storage: Storage, warehouse: Path) -> None:
    """Write the leaderboard and the index that links to it, without the pages of the crashes."""
    table = _table(*query.rows_of(warehouse, _TABLE))
    _publish_index(storage, warehouse, table, sound_manifest(storage, FOLDER))


def _publish_index(storage: Storage, warehouse: Path, table: list[dict[str, Any]], made: Manifest) -> None:
    """Write the index of a table's crashes, and the manifest of it and of what is already made."""
    rights = _rights(table, read_records(storage, [row["key"] for row in table]))
    index = {page.name: page for page in _write_index(storage, warehouse, table, rights, made.files)}
    write_manifest(storage, FOLDER, Manifest(made.files | index, made.made_of))


def benchmark_is_whole(storage: Storage) -> bool:
    """Return whether every file of the benchmark exists with its recorded size."""
    files = sound_manifest(storage, FOLDER).files
    return bool(files) and not any(not_as_listed(storage, files.values()))


def _crashes(
    workspace: Workspace, stage_outcomes: Sequence[Mapping[str, Any]], table: Sequence[Mapping[str, Any]]
) -> list[_Crash]:
    keys = [row["key"] for row in table]
    files = {each.key: each for each in crash_files(workspace, keys)}
    records = {key: each.records for key, each in files.items()}
    outcomes: dict[str, list[Mapping[str, Any]]] = {}
    for row in stage_outcomes:
        outcomes.setdefault(row["key"], []).append(row)
    rights = _rights(table, records)
    at_once, traffic = read_notes(workspace.storage), traffic_files(workspace.storage)
    crashes = []
    for crash in table:
        key, said = crash["key"], tuple(outcomes.get(crash["key"], ()))
        of_files = made_of(records[key], traffic.get(key, ()))
        parts = [VERSION, crash, of_files, [each["outcome"] for each in said], rights[key].attributions]
        digest = hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()
        made = at_once[key].files if key in at_once and at_once[key].made_of == of_files else None
        crashes.append(_Crash(files[key], crash, said, rights[key], digest, key in traffic, made))
    return crashes


def _rights(table: Sequence[Mapping[str, Any]], records: Mapping[str, Records]) -> dict[str, Rights]:
    """Return the attribution of each crash's map; for a crash without a map, that of its cohort's maps."""
    own = {row["key"]: attribution for row in table if (attribution := map_attribution(records[row["key"]]))}
    cohorts: dict[str, set[str]] = {}
    for row in table:
        if row["key"] in own:
            cohorts.setdefault(row["cohort"], set()).add(own[row["key"]])
    return {
        row["key"]: Rights.of([own[row["key"]]] if row["key"] in own else cohorts.get(row["cohort"], ()))
        for row in table
    }


def _tasks(workspace: Workspace, crashes: Sequence[_Crash], workers: int) -> list[tuple[_Crash, ...]]:
    size = max(1, min(workspace.settings.execution.chunk_size, math.ceil(len(crashes) / (4 * workers))))
    return [tuple(crashes[start : start + size]) for start in range(0, len(crashes), size)]


def get_ready() -> None:
    """Import a worker's modules before its first page."""
    import_frozen((*MADE_WITH, "trace_dag.pages.crash_page"))


def _make(crashes: Sequence[_Crash]) -> tuple[list[StoredFile], dict[str, str]]:
    """Return packages and pages of some crashes, and the errors by crash."""
    made: list[StoredFile] = []
    errors: dict[str, str] = {}
    for crash in crashes:
        try:
            made += _make_one(crash.files.unread(), crash)
        except Failure as failure:
            errors[crash.key] = str(failure)
        except Exception as error:
            # One crash without a page keeps no other from having one.
            errors[crash.key] = "".join(traceback.format_exception(error))
    return made, errors


@gc_paused()
def _make_one(files: CrashFiles, crash: _Crash) -> list[StoredFile]:
    from trace_dag.flow.crash_picture import draw_sketch
    from trace_dag.pages.crash_page import CrashPage, Download, write_crash_page
    from trace_dag.pages.replay import PAGE

    storage, key = files.storage, files.key
    made = crash.made
    if made is None:
        traffic = read_traffic(files) if crash.has_traffic else None
        made = make_files(files, accepted=FinalState(crash.row["final_state"]).accepted, traffic=traffic)
    sizes = {file.name: file.size for file in made}
    if package_name(key) in sizes:
        downloads = [Download("Scenario package", f"../packages/{key}.zip", sizes[package_name(key)])]
    else:
        stored = {label: files.stored(artefact) for label, artefact in _OFFERED.items()}
        downloads = [Download(label, f"../../{file.name}", file.size) for label, file in stored.items() if file]
    drawn = files.picture("png")
    picture = f"../../{drawn.name}" if drawn else None
    if drawn is None and (sketch := draw_sketch(files)):
        made = (*made, storage.write(sketch_name(key), sketch.encode()))
        picture = f"{key}.svg"
    page = CrashPage(
        crash.row,
        crash.outcomes,
        crash.rights,
        record=files.load(RECORD) if files.has(RECORD) else None,
        map_report=files.load(MAP_REPORT) if files.has(MAP_REPORT) else None,
        rejected_map=files.load(REJECTED_REPORT) if files.has(REJECTED_REPORT) else None,
        estimate=files.load(ESTIMATE) if files.has(ESTIMATE) else None,
        verdict=files.load(VERDICT) if files.has(VERDICT) else None,
        sampled=files.load(SAMPLED) if files.has(SAMPLED) else None,
        picture=picture,
        replay=f"../{PAGE}?{key}" if replay_name(key) in sizes else None,
        downloads=downloads,
    )
    return [*made, storage.write(page_name(key), write_crash_page(page))]


def is_made_by_this_code(storage: Storage) -> bool:
    """Return whether packages and pages were made by the present code."""
    return sound_manifest(storage, FOLDER).made_of.get(_BY_CODE) == VERSION


def _remove_others(storage: Storage, kept: Mapping[str, Collection[str]]) -> None:
    """Remove files of crashes that are not among the kept keys, by folder.

    These are packages of crashes that are no longer accepted.
    """
    for folder, keys in kept.items():
        for name in storage.list(f"{FOLDER}/{folder}"):
            if Path(name).stem not in keys:
                storage.delete(name)


def _write_index(
    storage: Storage,
    warehouse: Path,
    table: Sequence[Mapping[str, Any]],
    rights: Mapping[str, Rights],
    files: Mapping[str, StoredFile],
) -> list[StoredFile]:
    """Return the pages about all crashes together.

    ``files`` are the files made for single crashes.
    """
    from trace_dag.pages.site import IndexRows, static_files, write_index

    names = ("funnel", "coverage", "failure_reasons", "evaluations")
    ranked = ("leaderboard", "leaderboard_by_class", "agent_probabilities")
    funnel, coverage, reasons, driven, *of_agents = query.rows_of(warehouse, (*names, *ranked))
    searched = {row["key"]: row for row in query.rows_of(warehouse, ("catalogue",))[0]}
    table = [searched.get(row["key"], {}) | dict(row) for row in table]
    moving = [
        {**row, "sketched": sketch_name(row["key"]) in files} for row in table if thumbnail_name(row["key"]) in files
    ]
    shown = IndexRows(table, moving, funnel, coverage, reasons, any(of_agents))
    runs = [row for row in driven if row["case_id"] == row["key"]]
    of_all = Rights.of(attribution for each in rights.values() for attribution in each.attributions)
    return [
        storage.write(INDEX, write_index(shown, of_all)),
        storage.write(LEADERBOARD, write_leaderboard(runs, *of_agents)),
        *(storage.write(f"{FOLDER}/{name}", data) for name, data in static_files().items()),
    ]


# --- verification ----------------------------------------------------------------------------------------------------
def verify_benchmark(storage: Storage, *, contents: bool = False) -> Iterator[Disagreement]:
    """Yield pages and packages that differ from their manifest; ``contents`` compares the bytes as well.

    Without a readable manifest every file counts as suspect.
    """
    name = manifest_name(FOLDER)
    there = [each for folder in (FOLDER, *FOLDERS_OF_CRASHES) for each in storage.list(folder) if each != name]
    try:
        manifest = read_manifest(storage, FOLDER)
        if there and not manifest.files:
            raise DamagedFile(name, "it is not there")
    except DamagedFile as damaged:
        yield Disagreement(DisagreementKind.DAMAGED_PAGE, str(damaged), file=name)
        for each in there:
            yield Disagreement(DisagreementKind.DAMAGED_PAGE, f"{name} does not say whether {each} is whole", file=each)
        return
    for file, detail in not_as_listed(storage, manifest.files.values(), contents=contents):
        key = crash_of(file.name)
        yield Disagreement(
            DisagreementKind.DAMAGED_PAGE, detail, key if key in manifest.made_of else None, file=file.name
        )
    for each in there:
        if each not in manifest.files:
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{each} is not in {name}", file=each)


def repair_benchmark(found: Iterable[Disagreement], aside: Quarantine) -> None:
    """Put damaged files aside, so that the next build of the benchmark makes them again."""
    for each in found:
        if each.kind is DisagreementKind.DAMAGED_PAGE and each.file:
            aside.move(each.file, each.detail)
            if each.key is not None:  # its page goes too: its lack is seen without asking for single files
                aside.move(page_name(each.key), each.detail)
