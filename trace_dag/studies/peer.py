"""Our crashes beside the published benchmark's of the same cases: simulated alike, judged alike."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from trace_dag.crash.event_sequence import Missing, event_sequence
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import DamagedFile, UserError
from trace_dag.flow.artefacts import RECORD
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.records import OnProblem, raised
from trace_dag.flow.workspace import Workspace
from trace_dag.studies.stored_crashes import judged_crashes, stored_crash
from trace_dag.studies.tables import PUBLISHED, store
from trace_dag.verdict.peer import ComparisonRow, compare

_PEER_TIME_LIMIT_S = 45.0  # the slowest published vehicle takes half a minute to the crash


@dataclass(frozen=True)
class PublishedComparison:
    """The judgements of both benchmarks; ``left_out`` says by crash why neither of them is judged on it."""

    rows: list[ComparisonRow]
    left_out: dict[str, str]


def _no_collision(record: CrashRecord) -> str | None:
    """Why a crash does not begin with two vehicles that meet; None if it does."""
    sequence = event_sequence(record)
    if isinstance(sequence, Missing):
        return sequence.sentence
    met = sequence.first.kind is EventKind.VEHICLE_CONTACT
    return None if met else f"event {sequence.first.number}, its first, is no contact of two vehicles"


def published_comparison(
    workspace: Workspace, cohort: str, folder: Path, *, on_problem: OnProblem = raised
) -> PublishedComparison:
    """Our crashes beside the published ones of the same cases: simulated alike, judged alike. Stored for the warehouse.

    Left out of both: a case whose report names no two vehicles that touched, since it has no collision to judge; and a
    case with a damaged file, which is passed to ``on_problem``.
    ``folder`` holds ``simulations/simulation_<stateCase>.json`` and ``maps/map_<stateCase>.xodr``, or folders of years
    that do, as :mod:`trace_dag.formats.published` writes them. Raises :class:`UserError` if it does not, or if none of
    its cases is in the cohort.
    """
    simulations = _simulations(folder)
    if not simulations:
        raise UserError(
            f"{folder}: no simulations/simulation_<stateCase>.json in it; the published benchmark's folder?"
        )
    rows: list[ComparisonRow] = []
    left_out: dict[str, str] = {}
    for key in workspace.registry.keys(cohort):
        case = key.partition("-")[2]
        files = stored_crash(workspace, key)
        simulation = simulations.get(key, simulations.get(case))
        if simulation is None or not files.has(RECORD):
            continue
        try:
            record = files.load(RECORD)
            no_collision = _no_collision(record)
            if no_collision is not None:
                left_out[key] = no_collision
                continue
            ours_of_case = judged_crashes(workspace, [key])
            theirs = _theirs(workspace, files, simulation, simulation.parents[1] / "maps" / f"map_{case}.xodr")
        except DamagedFile as damaged:
            on_problem(damaged)
            continue
        rows.append(theirs)
        for ours in ours_of_case:
            crash = ours.judged
            rows.append(
                compare(
                    "trace-dag", crash.record, crash.network, crash.hypothesis, crash.log, workspace.settings.verdict
                )
            )
    if not rows:
        raise UserError(
            f"{folder}: none of its {len(simulations)} cases is a read crash of cohort {cohort!r} in which two "
            "vehicles touched"
        )
    store(workspace, PUBLISHED, cohort, rows)
    return PublishedComparison(rows, left_out)


def _simulations(folder: Path) -> dict[str, Path]:
    """The scenarios of a published benchmark by their case numbers; those in a folder of a year by the crash's key."""
    found = {}
    for file in (*folder.glob("simulations/simulation_*.json"), *folder.glob("*/simulations/simulation_*.json")):
        case, within = file.stem.removeprefix("simulation_"), file.parents[1]
        found[case if within == folder else f"{within.name}-{case}"] = file
    return found


def _theirs(workspace: Workspace, files: CrashFiles, simulation: Path, map_file: Path) -> ComparisonRow:
    from trace_dag.roads.map.reader import read_opendrive
    from trace_dag.sim.embedded import EmbeddedBackend
    from trace_dag.sim.published import published_estimate, read_published
    from trace_dag.sim.run import simulate

    if not map_file.is_file():
        raise UserError(f"{map_file}: not there; every published simulation needs its map beside it")
    record, xodr = files.load(RECORD), map_file.read_bytes()
    network = read_opendrive(xodr, name=str(map_file))
    states = published_estimate(read_published(simulation.read_bytes(), name=str(simulation)), record)
    settings = workspace.settings.sim.model_copy(update={"time_limit_s": _PEER_TIME_LIMIT_S})
    (log,) = simulate(EmbeddedBackend(settings), network, xodr, states, settings, record=record)
    return compare(PUBLISHED, record, network, states.best, log, workspace.settings.verdict)
