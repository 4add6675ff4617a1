"""Files of one crash in the benchmark beside its page: replay, scenario package, moving picture.

A run lets its workers make them when the last stage of a crash is done (:func:`make_at_once`): the results of the
stages are still in memory then, while a build would have to read them back, and the workers stay busy to the end. The
benchmark's manifest lists the files made in this way; the others are made when the benchmark is built. Files of crashes
that are no longer registered are deleted. Does not belong here: pages, and files about all crashes
(:mod:`trace_dag.export.build`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Sequence, Set
from functools import partial
from typing import TYPE_CHECKING

from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.artefacts import ROAD_MAP, surroundings_of
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import status_of_valid, valid_records
from trace_dag.flow.manifests import Manifest, not_as_listed, sound_manifest, write_manifest
from trace_dag.flow.records import Records
from trace_dag.flow.tasks import MadeFiles

if TYPE_CHECKING:
    from trace_dag.agents.stored_traffic import StoredTraffic

FOLDER = "benchmark"
VERSION = "11"
"""Number of the code that makes pages, packages and replays; see :data:`trace_dag.flow.stages.VERSIONS`."""
REPLAYS = "replays"
FOLDERS_OF_CRASHES = tuple(f"{FOLDER}/{each}" for each in ("crashes", "packages", "thumbnails", REPLAYS))
MADE_WITH = (  # modules that take a while to load, also those that are imported where they are used
    "jinja2",
    "resvg_py",
    "trace_dag.scenario.drives",
    "trace_dag.export.package",
    "trace_dag.pages.picture_motion",
    "trace_dag.agents.replays",
)
_FOLDERS = (*(stage.value for stage in Stage), "reports", "pictures", *FOLDERS_OF_CRASHES)


def page_name(key: str) -> str:
    """Return the path of a crash's page below the root."""
    return f"{FOLDER}/crashes/{key}.html"


def package_name(key: str) -> str:
    """Return the path of an accepted crash's package below the root."""
    return f"{FOLDER}/packages/{key}.zip"


def replay_name(key: str) -> str:
    """Return the path below the root of a crash's data for ``replay.html``."""
    return f"{FOLDER}/{REPLAYS}/{key}.js"


def thumbnail_name(key: str) -> str:
    """Return the path of an accepted crash's moving picture below the root."""
    return f"{FOLDER}/thumbnails/{key}.svg"


def make_files(files: CrashFiles, *, accepted: bool, traffic: StoredTraffic | None = None) -> tuple[StoredFile, ...]:
    """Make and store the files of a crash: a replay if it was simulated, the others if it is accepted."""
    from trace_dag.agents.replays import content_of
    from trace_dag.export.package import zip_files
    from trace_dag.export.packaging import package_of
    from trace_dag.pages.picture_motion import draw_thumbnail
    from trace_dag.pages.replay import replay_script

    storage, key, log = files.storage, files.key, files.shown_log()
    if log is None:
        return ()
    replay = content_of(files, log, traffic)
    made = {replay_name(key): replay_script(replay)}
    if accepted:
        made[package_name(key)] = zip_files(package_of(files, replay, traffic=traffic), folder=key)
        made[thumbnail_name(key)] = draw_thumbnail(files.load(ROAD_MAP), log, surroundings_of(files)).encode()
    return tuple(storage.write(name, data) for name, data in made.items())


def made_of(records: Records, traffic: Sequence[StoredFile] = ()) -> str:
    """Return a digest of the inputs of a crash's files: its artefacts, picture and traffic, and the code."""
    artefacts = (file for record in records.values() for file in (*record.artefacts, *record.pictures))
    listed = [file.sha256 for file in (*artefacts, *traffic)]
    return hashlib.sha256(json.dumps([VERSION, listed]).encode()).hexdigest()


def make_at_once(storage: Storage, keys: Collection[str]) -> Callable[[CrashFiles], MadeFiles | None]:
    """Return the function that makes the files of a crash at its end, for :func:`trace_dag.flow.batch.run_stages`.

    It makes none if the manifest lists some already, which only a build may replace, or if a later stage's record is
    older than this run. Traffic around a crash is also left to the build. The present files are listed once for the
    whole run, because an object store needs two requests, one of them a listing, to report one missing file.
    """
    names = [name(key) for name in (replay_name, package_name, thumbnail_name) for key in keys]
    already = frozenset(crash_of(name) for name in storage.sizes(names))
    return partial(_made_at_once, already=already)


def _made_at_once(files: CrashFiles, already: Set[str]) -> MadeFiles | None:
    records = files.records
    valid = valid_records(records)
    if valid.keys() != records.keys() or files.key in already:
        return None
    accepted = status_of_valid(files.key, valid).final_state.accepted
    return MadeFiles(make_files(files, accepted=accepted), made_of(valid))


def note_made(storage: Storage, made: Mapping[str, MadeFiles]) -> None:
    """Record the files that the workers of a run made, by crash."""
    if not made:
        return
    before = sound_manifest(storage, FOLDER)
    files = {name: file for name, file in before.files.items() if crash_of(name) not in made}
    files |= {file.name: file for each in made.values() for file in each.files}
    made_of = {key: digest for key, digest in before.made_of.items() if key not in made}  # their pages are outdated
    made_of |= {_at_once(key): each.made_of for key, each in made.items()}
    write_manifest(storage, FOLDER, Manifest(files, made_of))


def read_notes(storage: Storage) -> dict[str, MadeFiles]:
    """Return the files that workers have made since the last build of the benchmark, by crash.

    Crashes with a missing file are left out.
    """
    manifest = sound_manifest(storage, FOLDER)
    files: dict[str, list[StoredFile]] = {}
    for file in manifest.files.values():
        if _at_once(crash_of(file.name)) in manifest.made_of:
            files.setdefault(crash_of(file.name), []).append(file)
    gone = {crash_of(file.name) for each in files.values() for file, _ in not_as_listed(storage, each)}
    return {
        key: MadeFiles(tuple(each), manifest.made_of[_at_once(key)]) for key, each in files.items() if key not in gone
    }


def _at_once(key: str) -> str:
    """Return the name of the manifest of a crash's files that were made before its page."""
    return f"beside the page of {key}"


# --- removal ---------------------------------------------------------------------------------------------------------
def delete_artefacts(storage: Storage, keys: Collection[str]) -> int:
    """Delete every file of some crashes below the root and return the number.

    These are artefacts, records, copies of reports, and pages.
    """
    wanted = set(keys)
    names = [
        name
        for folder in _FOLDERS
        for name in storage.list(folder)
        if name.rpartition("/")[2].partition(".")[0] in wanted
    ]
    for name in names:
        storage.delete(name)
    before = sound_manifest(storage, FOLDER)
    if before.made_of.keys() & wanted:
        files = {name: file for name, file in before.files.items() if crash_of(name) not in wanted}
        made_of = {key: digest for key, digest in before.made_of.items() if key not in wanted}
        write_manifest(storage, FOLDER, Manifest(files, made_of))
    return len(names)
