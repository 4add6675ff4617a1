"""Cohorts compared: verdicts against negative controls, and our crashes beside a published benchmark's.

Works on what is stored and changes no crash's artefacts. The rows lie at ``ROOT/comparisons/<kind>-<cohort>.json``,
from where the warehouse takes them.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from trace_dag.crash.kind import another_kind, untold_meeting
from trace_dag.errors import DamagedFile, Failure, UserError
from trace_dag.pipeline.artefacts import ESTIMATE, LOGS, RECORD, ROAD_MAP, VERDICT
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.flow import CrashFiles
from trace_dag.pipeline.ledgers import Complaint, raised, read_listed, write_ledger
from trace_dag.pipeline.progress import Progress, untold
from trace_dag.pipeline.records import Records, log_complaint, read_records
from trace_dag.pipeline.registry import CrashSource
from trace_dag.pipeline.standing import valid_records
from trace_dag.storage import Storage, StoredFile
from trace_dag.verdict.controls import (
    ControlRow,
    JudgedCrash,
    against_other_reports,
    shifted_estimate,
    shifted_in_time,
    shifted_row,
    true_pairing,
)
from trace_dag.verdict.peer import ComparisonRow, compare

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

FOLDER = "comparisons"
CONTROLS = "controls"
PUBLISHED = "published"
ESTIMATORS = "estimators"
PERTURBED = "perturbed"
_SEED = 1
_PEER_TIME_LIMIT_S = 45.0  # the slowest published vehicle takes half a minute to the crash


@dataclass(frozen=True, eq=False)
class StoredCrash:
    """A crash that reached a verdict: its files, and the hypothesis the verdict is about."""

    files: CrashFiles
    judged: JudgedCrash
    accepted: bool


def stored_crash(pipeline: Pipeline, key: str) -> CrashFiles:
    """One crash's artefacts; :class:`UserError` for a key that is not registered."""
    source = pipeline.registry.sources([key])[key]
    return _files(pipeline, source, read_records(pipeline.storage, [key])[key], key)


def crash_files(
    pipeline: Pipeline, keys: Collection[str], *, complain: Complaint = log_complaint
) -> Iterator[CrashFiles]:
    """The artefacts of some registered crashes, in their order; ``complain`` hears of records that are damaged."""
    sources, records = pipeline.registry.sources(keys), read_records(pipeline.storage, keys, complain=complain)
    return (_files(pipeline, sources[key], records[key], key) for key in keys)


def _files(pipeline: Pipeline, source: CrashSource, records: Records, key: str) -> CrashFiles:
    files = CrashFiles(key, source, pipeline.settings, pipeline.storage)
    for record in valid_records(records).values():
        files.accept(record)
    return files


def judged_crashes(
    pipeline: Pipeline,
    keys: Collection[str],
    *,
    most: int | None = None,
    tell: Progress = untold,
    complain: Complaint = raised,
) -> list[StoredCrash]:
    """Those of some crashes that have a verdict on a simulation; of more than ``most``, so many drawn at random.

    The same crashes give the same draw. ``tell`` hears how many of how many have been read, ``complain`` of those left
    out because something stored of them is damaged.
    """
    judged = [each for each in crash_files(pipeline, keys, complain=complain) if each.has(VERDICT)]
    if most is not None:
        judged = drawn(judged, most, _SEED)
    found = []
    for done, each in enumerate(judged, 1):
        tell(done, len(judged))
        try:
            found.append(read_judged(each))
        except Failure as failure:
            complain(failure)
    return found


def read_judged(files: CrashFiles) -> StoredCrash:
    """A crash that reached a verdict, read."""
    verdict = files.load(VERDICT)
    crash = JudgedCrash(
        files.load(RECORD),
        files.load(ROAD_MAP),
        files.load(ESTIMATE).hypotheses[verdict.hypothesis],
        files.load(LOGS)[verdict.hypothesis],
    )
    return StoredCrash(files, crash, verdict.accepted)


def drawn(crashes: Sequence[CrashFiles], most: int, seed: int) -> list[CrashFiles]:
    """All crashes, or ``most`` of them drawn at random, in their order."""
    if len(crashes) <= most:
        return list(crashes)
    chosen = np.random.default_rng(seed).choice(len(crashes), most, replace=False)
    return [crashes[index] for index in sorted(chosen)]


def negative_controls(
    pipeline: Pipeline,
    cohort: str,
    *,
    most: int,
    tell: Progress = untold,
    complain: Complaint = raised,
) -> list[ControlRow]:
    """Every judged crash of a cohort against its own report, every verified one against every other's report and with
    one vehicle late. Stored for the warehouse.

    Each crash meets every other, so a cohort with more than ``most`` verdicts is represented by so many of them, drawn
    at random. ``tell`` hears how many of how many are read, and then judged; ``complain`` of those left out.

    Raises :class:`UserError` for a cohort that is not registered or has no verdicts yet.
    """
    from trace_dag.sim.embedded import EmbeddedBackend
    from trace_dag.sim.run import simulate

    crashes = judged_crashes(pipeline, pipeline.registry.keys(cohort), most=most, tell=tell, complain=complain)
    if not crashes:
        raise UserError(f"no crash of cohort {cohort!r} has a verdict yet; trace-dag run --cohort {cohort} makes them")
    settings = pipeline.settings
    rows = [true_pairing(crash.judged, settings.verdict) for crash in crashes]
    verified = [crash.judged for crash in crashes if crash.accepted]
    backend = EmbeddedBackend(settings.sim)
    for done, crash in enumerate(verified, 1):
        rows += against_other_reports(crash, verified, settings.verdict)
        shift = shifted_in_time(crash.hypothesis)
        log = None
        if shift is not None:
            states = shifted_estimate(crash, shift)
            (log,) = simulate(backend, crash.network, b"", states, settings.sim, record=crash.record)
        rows.append(shifted_row(crash, shift, log, settings.verdict))
        tell(done, len(verified))
    store(pipeline, CONTROLS, cohort, rows)
    return rows


@dataclass(frozen=True)
class PublishedComparison:
    """The judgements of both benchmarks; ``left_out`` says by crash why neither of them is judged on it."""

    rows: list[ComparisonRow]
    left_out: dict[str, str]


def published_comparison(
    pipeline: Pipeline, cohort: str, folder: Path, *, complain: Complaint = raised
) -> PublishedComparison:
    """Our crashes beside the published ones of the same cases: simulated alike, judged alike. Stored for the warehouse.

    A case in whose report no two vehicles are known to have touched is left out of both: it has no collision to judge.
    So is a case of which something stored is damaged, which ``complain`` hears of.
    ``folder`` holds ``simulations/simulation_<stateCase>.json`` and ``maps/map_<stateCase>.xodr``. Raises
    :class:`UserError` if it does not, or if none of its cases is in the cohort.
    """
    simulations = {file.stem.removeprefix("simulation_"): file for file in folder.glob("simulations/simulation_*.json")}
    if not simulations:
        raise UserError(
            f"{folder}: no simulations/simulation_<stateCase>.json in it; the published benchmark's folder?"
        )
    rows: list[ComparisonRow] = []
    left_out: dict[str, str] = {}
    for key in pipeline.registry.keys(cohort):
        case = key.partition("-")[2]
        files = stored_crash(pipeline, key)
        if case not in simulations or not files.has(RECORD):
            continue
        try:
            record = files.load(RECORD)
            no_collision = untold_meeting(record) or another_kind(record)
            if no_collision is not None:
                left_out[key] = no_collision
                continue
            ours_of_case = judged_crashes(pipeline, [key])
            theirs = _theirs(pipeline, files, simulations[case], folder / "maps" / f"map_{case}.xodr")
        except DamagedFile as damaged:
            complain(damaged)
            continue
        rows.append(theirs)
        for ours in ours_of_case:
            crash = ours.judged
            rows.append(
                compare(
                    "trace-dag", crash.record, crash.network, crash.hypothesis, crash.log, pipeline.settings.verdict
                )
            )
    if not rows:
        raise UserError(
            f"{folder}: none of its {len(simulations)} cases is a read crash of cohort {cohort!r} in which two "
            "vehicles touched"
        )
    store(pipeline, PUBLISHED, cohort, rows)
    return PublishedComparison(rows, left_out)


def _theirs(pipeline: Pipeline, files: CrashFiles, simulation: Path, map_file: Path) -> ComparisonRow:
    from trace_dag.roads.opendrive_reader import read_opendrive
    from trace_dag.sim.embedded import EmbeddedBackend
    from trace_dag.sim.published import published_estimate, read_published
    from trace_dag.sim.run import simulate

    if not map_file.is_file():
        raise UserError(f"{map_file}: not there; every published simulation needs its map beside it")
    record, xodr = files.load(RECORD), map_file.read_bytes()
    network = read_opendrive(xodr, name=str(map_file))
    states = published_estimate(read_published(simulation.read_bytes(), name=str(simulation)), record)
    settings = pipeline.settings.sim.model_copy(update={"time_limit_s": _PEER_TIME_LIMIT_S})
    (log,) = simulate(EmbeddedBackend(settings), network, xodr, states, settings, record=record)
    return compare(PUBLISHED, record, network, states.best, log, pipeline.settings.verdict)


def store(pipeline: Pipeline, kind: str, cohort: str, rows: Sequence[DataclassInstance]) -> None:
    """Keep the rows of a comparison of a cohort, in place of those before."""
    judged = {"cohort": cohort, "rule_set": pipeline.settings.verdict.rule_set}
    content: list[dict[str, Any]] = [{**judged, **asdict(row)} for row in rows]
    store_comparison(pipeline.storage, kind, cohort, content)


_MADE_BY = {CONTROLS: "controls", PUBLISHED: "peer FOLDER", ESTIMATORS: "compare", PERTURBED: "controls --perturbed"}


def comparison_is_whole(storage: Storage, name: str, complain: Complaint) -> bool:
    """Whether a stored comparison is as it was written; if not, ``complain`` hears of it."""
    kind, _, cohort = name.removeprefix(f"{FOLDER}/").removesuffix(".json").partition("-")
    try:
        remedy = f"trace-dag {_MADE_BY[kind]} --cohort {cohort} makes it again"
        read_listed(storage, name.removesuffix(".json"), name, remedy=remedy)
    except DamagedFile as damaged:
        complain(damaged)
        return False
    return True


def store_comparison(
    storage: Storage, kind: str, cohort: str, rows: Sequence[Mapping[str, Any]], beside: Sequence[StoredFile] = ()
) -> None:
    """Keep the rows of a comparison of a cohort, and list them with the files made ``beside``."""
    subject = f"{FOLDER}/{kind}-{cohort}"
    try:
        file = storage.write(f"{subject}.json", json.dumps(rows, indent=0).encode())
    except ValueError as error:
        raise Failure(f"comparisons of cohort {cohort!r} cannot be stored: {error}") from error
    write_ledger(storage, subject, [file, *beside])


def replay(pipeline: Pipeline, key: str, replay_format: Literal["html", "gif", "webp", "mp4"]) -> bytes:
    """The replay of one crash as stored: a page or a moving picture.

    Raises :class:`UserError` for a crash that is not registered or was not simulated, or an MP4 without its extra.
    """
    from trace_dag.scenario.animation import write_animation
    from trace_dag.scenario.replay import write_html_player

    files = stored_crash(pipeline, key)
    if not files.has(LOGS):
        raise UserError(f"crash {key} was not simulated; trace-dag status tells where it stands")
    verdict = files.load(VERDICT) if files.has(VERDICT) else None
    logs = files.load(LOGS)
    log = logs[verdict.hypothesis if verdict else 0]
    record, network = files.load(RECORD), files.load(ROAD_MAP)
    if replay_format == "html":
        return write_html_player(record, network, log, verdict)
    return write_animation(record, network, log, verdict, image_format=replay_format)
