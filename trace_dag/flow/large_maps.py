"""Large map files are read once for all crashes that need an extract from them, before those of a batch are cut.

A file of a gigabyte takes a minute to read, and hardly more for three thousand sites than for one. So the first batch
that needs it has the pieces around all registered crashes cut whose extract is to be made and whose place is known;
later batches, and later runs, find them stored. A crash's piece is deleted once its extract is stored.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass

from trace_dag.cohorts.listings import listings_of
from trace_dag.cohorts.registry import RegisteredMap, ReportSource
from trace_dag.crash.parse import reported_position
from trace_dag.errors import Failure, Rejection, UserError
from trace_dag.flow.batch import first_stale
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.executors import Executor, WorkerLost, run_redoing_lost
from trace_dag.flow.products import Figure
from trace_dag.flow.records import read_records
from trace_dag.flow.stages.osm_extract import catalog_of
from trace_dag.flow.time_limit import SLOWEST_BYTES_PER_S, within
from trace_dag.flow.workspace import Workspace
from trace_dag.osm.catalog import MapFile, box_around, is_on_earth, may_cover
from trace_dag.osm.dividing import divide
from trace_dag.osm.large_map import Around, LargeMap, remove_pieces
from trace_dag.osm.types import Site
from trace_dag.progress import MapListener, MapProgress
from trace_dag.provenance import Outcome
from trace_dag.settings import OsmSettings
from trace_dag.stage import Stage
from trace_dag.storage import Storage

log = logging.getLogger(__name__)

_TOLD_EVERY_S = 1.0
_PROGRESS = "progress.json"
_UP_TO_EXTRACT = (Stage.RAW_REPORT, Stage.CRASH_RECORD, Stage.OSM_EXTRACT)


@dataclass(frozen=True)
class _Division:
    """The pieces of one file around some sites, as a task for a worker."""

    crash: CrashFiles  # any that the file is for: its maps, its services
    file: RegisteredMap
    sites: tuple[Around, ...]
    limit_s: float


@contextmanager
def large_maps_divided(
    workspace: Workspace,
    executor: Executor,
    crashes: Sequence[CrashFiles],
    batch: Sequence[CrashFiles],
    *,
    all_again: bool,
) -> Iterator[None]:
    """While some crashes are cut: has the pieces stored that they need of large files, and those of all other crashes
    that will; afterwards takes away the pieces of those of the ``batch`` that are done.

    ``all_again``: extracts are made again though nothing has changed, those of other crashes too, presumably. What goes
    wrong here is no failure: it goes wrong again where the crash is cut, and is its failure there.
    """
    tasks: list[_Division] = []
    with _going_on("no pieces of large maps cut beforehand"):
        tasks = _divisions(workspace, crashes, all_again=all_again)
    if tasks:
        with _telling(workspace.storage, tasks, workspace.map_listener):
            for answer in run_redoing_lost(executor, _divide, tasks, lambda task: [task]):
                said = answer.result.detail if isinstance(answer.result, WorkerLost) else answer.result
                if said:
                    log.warning("%s: no pieces cut beforehand (%s)", answer.task.file.location, said)
    yield
    with _going_on("pieces of large maps not taken away"):
        if any(_large_files(batch)):
            remove_pieces(workspace.storage, _done(workspace.storage, [each.key for each in batch]))


@contextmanager
def _going_on(without: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        log.warning("%s (%s)", without, error, exc_info=not isinstance(error, Failure))


def with_pieces(crashes: Sequence[CrashFiles]) -> dict[str, set[str]]:
    """The crashes whose pieces of large files are stored, by the SHA-256 of each file."""
    found: dict[str, set[str]] = {}
    for crash, registered, file in _large_files(crashes):
        own = _own_places(crashes, registered)
        found[file.digest] = set(own) - {
            each.key for each in _without_piece(file, own, crash.storage, crash.settings.osm)
        }
    return found


def _large_files(crashes: Sequence[CrashFiles]) -> Iterator[tuple[CrashFiles, RegisteredMap, MapFile]]:
    """The large files of some crashes, each once, with a crash it is for."""
    seen: set[str] = set()
    for maps, crash in {crash.source.maps: crash for crash in crashes}.items():
        registered = {each.sha256: each for each in maps}
        for file in catalog_of(maps, crash.services).files:
            if file.divisible and file.digest not in seen:
                seen.add(file.digest)
                yield crash, registered[file.digest], file


def _divisions(workspace: Workspace, crashes: Sequence[CrashFiles], *, all_again: bool) -> list[_Division]:
    tasks = []
    execution = workspace.settings.execution
    for crash, registered, file in _large_files(crashes):
        storage, settings = workspace.storage, workspace.settings.osm
        own = _own_places(crashes, registered)
        if not _without_piece(file, own, storage, settings):
            continue
        places = {**_places_of_others(workspace, registered, all_again=all_again), **own}
        sites = _without_piece(file, places, storage, settings)
        limit_s = execution.stage_time_limit_s + registered.size / SLOWEST_BYTES_PER_S
        tasks.append(_Division(crash.unread(), registered, sites, limit_s))
    return tasks


def _without_piece(
    file: MapFile, places: Mapping[str, tuple[float, float]], storage: Storage, settings: OsmSettings
) -> tuple[Around, ...]:
    """The places that a file may cover, with their boxes, whose pieces are not stored."""
    sites = [site for key, place in places.items() if is_on_earth(site := Site(key, *place))]
    around = [
        Around(site.key, box_around(site, settings.radius_m), box_around(site, settings.surroundings_radius_m))
        for site in sites
    ]
    covered = [each for each in around if may_cover(file.header, each.box)]
    return tuple(file.kept_in(storage).without_piece(covered, service_roads=settings.service_roads))


def _own_places(crashes: Sequence[CrashFiles], registered: RegisteredMap) -> dict[str, tuple[float, float]]:
    """Where those of some crashes are that a file is for."""
    return {each.key: _place(each.figures(Stage.CRASH_RECORD)) for each in crashes if registered in each.source.maps}


def _place(figures: Mapping[str, Figure]) -> tuple[float, float]:
    return float(figures["latitude_deg"] or 0), float(figures["longitude_deg"] or 0)


def _places_of_others(
    workspace: Workspace, registered: RegisteredMap, *, all_again: bool
) -> dict[str, tuple[float, float]]:
    """Where all registered crashes are that the file is for and whose extract is to be made, as far as that is known:
    from their records, or from reports that are at hand."""
    reports: dict[str, ReportSource] = {}
    for cohort in workspace.registry.cohorts().values():
        if any(each.sha256 == registered.sha256 for each in cohort.maps):
            reports |= cohort.reports
    stale = set(reports) if all_again else set(first_stale(workspace, sorted(reports), _UP_TO_EXTRACT))
    records = read_records(workspace.storage, sorted(stale), [Stage.CRASH_RECORD])
    places = {}
    for key, of_crash in records.items():
        record = of_crash.get(Stage.CRASH_RECORD)
        if record is not None and "latitude_deg" in record.figures:
            places[key] = _place(record.figures)
    unread = {key: reports[key] for key in stale if key not in places}
    for key, listing in listings_of(workspace.storage, unread).items():
        try:
            places[key] = reported_position(listing.latitude_deg, listing.longitude_deg)
        except Rejection:
            continue
    return places


def _divide(task: _Division) -> str:
    """Cut the pieces of a file, in a worker; what is wrong, in words."""
    service_roads = task.crash.settings.osm.service_roads
    try:
        large = _large_of(task)
        tell = _Noting(large)
        what = f"reading {large.path.name}"
        within(task.limit_s, what, lambda: divide(large, task.sites, service_roads=service_roads, tell=tell))
    except (UserError, Failure) as error:
        return str(error)
    return ""


class _Noting:
    """Notes in storage how far a file is read, where the run that waits for it finds it."""

    def __init__(self, large: LargeMap) -> None:
        self._large = large
        self._noted_s = 0.0

    def __call__(self, progress: MapProgress) -> None:
        if time.monotonic() - self._noted_s >= _TOLD_EVERY_S:
            self._large.storage.write(self._large.name(_PROGRESS), json.dumps(asdict(progress)).encode())
            self._noted_s = time.monotonic()


@contextmanager
def _telling(storage: Storage, tasks: Sequence[_Division], listener: MapListener) -> Iterator[None]:
    """Tell meanwhile how far each file is read, and in the end that it is done with."""
    notes = [_large_of(task).name(_PROGRESS) for task in tasks]
    over = threading.Event()

    def look() -> None:
        while not over.wait(_TOLD_EVERY_S):
            for data in storage.read_many(notes).values():
                listener(MapProgress(**json.loads(data)))

    looking = threading.Thread(target=look, name="map progress", daemon=True)
    looking.start()
    try:
        yield
    finally:
        over.set()
        looking.join()
        for name in notes:
            storage.delete(name)
    for task in tasks:
        size, count = task.file.size, len(task.sites)
        listener(MapProgress(task.file.location.rpartition("/")[2], size, size, count, count))


def _large_of(task: _Division) -> LargeMap:
    catalog = catalog_of(task.crash.source.maps, task.crash.services)
    return next(each for each in catalog.files if each.digest == task.file.sha256).kept_in(task.crash.storage)


def _done(storage: Storage, keys: Collection[str]) -> set[str]:
    """The crashes whose extract is stored, or that never need one."""
    done = set()
    for key, records in read_records(storage, sorted(keys), _UP_TO_EXTRACT).items():
        extract = records.get(Stage.OSM_EXTRACT)
        made = extract is not None and extract.outcome is Outcome.ACCEPTED and not extract.failed_attempt
        if made or any(record.outcome is Outcome.REJECTED for record in records.values()):
            done.add(key)
    return done
