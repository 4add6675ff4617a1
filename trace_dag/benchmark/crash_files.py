"""What the benchmark has of one crash beside its page: its replay, its scenario package, its moving picture.

A run lets its workers make them when the last stage of a crash is done (:func:`making_at_once`): all that the stages
made is at hand then, where whoever builds the benchmark would have to read it back, and the workers have something to
do to the end. Until the benchmark is built, a ledger says what was made so; what it does not list is made by then. Does
not belong here: pages, and what all crashes have together (:mod:`trace_dag.benchmark.build`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Set
from functools import partial

from trace_dag.benchmark.packaging import package_of
from trace_dag.code_versions import code_version
from trace_dag.flow.artefacts import ROAD_MAP, surroundings_of
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.ledgers import ledger_name, not_as_listed, sound_ledger, write_ledger
from trace_dag.flow.records import Records
from trace_dag.flow.standing import FinalState, standing_of_valid, valid_records
from trace_dag.flow.tasks import MadeFiles
from trace_dag.provenance import crash_of
from trace_dag.storage import Storage, StoredFile

FOLDER = "benchmark"
REPLAYS = "replays"
MADE_WITH = (  # modules that take a while to load, also those that are imported where they are used
    "jinja2",
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "trace_dag.evaluation.drives",
    "trace_dag.scenario.package",
    "trace_dag.scenario.thumbnail",
    "trace_dag.studies.replays",
)
_AT_ONCE = "made_at_once"  # of the ledger


def package_name(key: str) -> str:
    """Where the package of a verified crash lies below the root."""
    return f"{FOLDER}/packages/{key}.zip"


def replay_name(key: str) -> str:
    """Where what ``replay.html`` shows of a crash lies below the root."""
    return f"{FOLDER}/{REPLAYS}/{key}.js"


def thumbnail_name(key: str) -> str:
    """Where the moving picture of a verified crash lies below the root."""
    return f"{FOLDER}/thumbnails/{key}.svg"


def make_files(files: CrashFiles, *, verified: bool) -> tuple[StoredFile, ...]:
    """Make and store what there can be of a crash: a replay if it was simulated, the rest if it is verified."""
    from trace_dag.scenario.package import zip_files
    from trace_dag.scenario.replay import replay_script
    from trace_dag.scenario.thumbnail import moving_thumbnail
    from trace_dag.studies.replays import content_of

    storage, key, log = files.storage, files.key, files.shown_log()
    if log is None:
        return ()
    replay = content_of(files, log)
    made = {replay_name(key): replay_script(replay)}
    if verified:
        made[package_name(key)] = zip_files(package_of(files, replay), folder=key)
        made[thumbnail_name(key)] = moving_thumbnail(files.load(ROAD_MAP), log, surroundings_of(files)).encode()
    return tuple(storage.write(name, data) for name, data in made.items())


def made_of(records: Records) -> str:
    """A digest of what the files of a crash are made of: its artefacts, its picture, and the code."""
    listed = [file.sha256 for record in records.values() for file in (*record.artefacts, *record.pictures)]
    return hashlib.sha256(json.dumps([code_version((__name__,)).digest, listed]).encode()).hexdigest()


def making_at_once(storage: Storage, keys: Collection[str]) -> Callable[[CrashFiles], MadeFiles | None]:
    """What makes the files of a crash of a run that has come to its end, for :func:`trace_dag.flow.batch.run_stages`.

    It makes none where some are there already, which the ledger of the benchmark lists: they are for whoever builds it
    to replace; nor where a later stage's record is from before this run. What is there is asked once for the whole run:
    an object store takes two requests, one of them a listing, to say of one file that it is not there.
    """
    names = [name(key) for name in (replay_name, package_name, thumbnail_name) for key in keys]
    return partial(_made_at_once, already=frozenset(crash_of(name) for name in storage.sizes(names)))


def _made_at_once(files: CrashFiles, already: Set[str]) -> MadeFiles | None:
    records = files.records
    valid = valid_records(records)
    if valid.keys() != records.keys() or files.key in already:
        return None
    verified = standing_of_valid(files.key, valid).final_state is FinalState.VERIFIED
    return MadeFiles(make_files(files, verified=verified), made_of(valid))


def note_made(storage: Storage, made: Mapping[str, MadeFiles]) -> None:
    """Note what the workers of a run made at once, by crash."""
    if not made:
        return
    ledger = sound_ledger(storage, _AT_ONCE)
    kept = [file for file in ledger.files.values() if crash_of(file.name) not in made]
    files = [file for each in made.values() for file in each.files]
    write_ledger(storage, _AT_ONCE, [*kept, *files], ledger.made_of | {key: each.made_of for key, each in made.items()})


def noted(storage: Storage) -> dict[str, MadeFiles]:
    """What workers have made at once since the benchmark was last built, by crash, where all of it is still there."""
    ledger = sound_ledger(storage, _AT_ONCE)
    gone = {crash_of(file.name) for file, _ in not_as_listed(storage, ledger.files.values())}
    files: dict[str, list[StoredFile]] = {key: [] for key in ledger.made_of if key not in gone}
    for file in ledger.files.values():
        if crash_of(file.name) in files:
            files[crash_of(file.name)].append(file)
    return {key: MadeFiles(tuple(each), ledger.made_of[key]) for key, each in files.items()}


def forget_noted(storage: Storage) -> None:
    """Let the note go, when the ledger of the benchmark lists the files."""
    storage.delete(ledger_name(_AT_ONCE))
