"""Crashes to watch: as they were simulated, or with an agent in a driver's place."""

from __future__ import annotations

from typing import Literal

from trace_dag.errors import UserError
from trace_dag.evaluation.agent_main import AgentLimits
from trace_dag.evaluation.agent_process import AgentProcess
from trace_dag.evaluation.agents import AgentFault
from trace_dag.evaluation.cases import Case
from trace_dag.evaluation.evaluate import Conditions, run
from trace_dag.evaluation.metrics import DriveOutcome, measure, outcome_of
from trace_dag.evaluation.registry import resolve
from trace_dag.evaluation.traffic import Traffic
from trace_dag.flow.artefacts import RECORD, ROAD_MAP, VERDICT, CrashArtefacts, surroundings_of
from trace_dag.flow.workspace import Workspace
from trace_dag.sim.backends import backend
from trace_dag.sim.types import SimulationLog
from trace_dag.studies.cases import AgentRole, load_case, number_of, verified_cases
from trace_dag.units import mps_to_mph

ReplayFormat = Literal["html", "webp", "gif", "mp4"]


def replay(crash: CrashArtefacts, replay_format: ReplayFormat) -> bytes:
    """The replay of one crash as stored: a page or a moving picture.

    Raises :class:`UserError` for a crash that was not simulated, or an MP4 without its extra.
    """
    from trace_dag.scenario.animation import write_animation
    from trace_dag.scenario.replay import write_html_player

    log = crash.shown_log()
    if log is None:
        raise UserError(f"crash {crash.key} was not simulated; trace-dag status tells where it stands")
    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    verdict = crash.load(VERDICT) if crash.has(VERDICT) else None
    if replay_format == "html":
        return write_html_player(record, network, log, verdict, surroundings=surroundings_of(crash))
    return write_animation(record, network, log, verdict, image_format=replay_format)


def replay_with(
    workspace: Workspace, key: str, agent: str, role: AgentRole, traffic: Traffic, replay_format: ReplayFormat
) -> bytes:
    """The replay of a verified crash with an agent in somebody's place, under the usual conditions.

    Raises :class:`UserError` for a crash that is not verified and an agent that is not there or is faulty.
    """
    from trace_dag.scenario.animation import write_animation
    from trace_dag.scenario.drive import Drive
    from trace_dag.scenario.replay import write_html_player

    (stored,) = verified_cases(workspace, None, [key])
    case = load_case(stored)
    simulation = backend(workspace.settings.sim).load(case.network, case.xodr, friction=case.friction)
    ego = number_of(case, role)
    driver = AgentProcess(resolve(agent), AgentLimits())
    try:
        log = run(case, ego, driver, Conditions(traffic=traffic), simulation)
    except AgentFault as fault:
        raise UserError(f"--agent {agent} is faulty in {key}: {fault}") from fault
    finally:
        driver.close()
    record = stored.files.load(RECORD)
    drive = Drive(agent, ego, _outcome(case, ego, log), case.recorded)
    if replay_format == "html":
        return write_html_player(record, case.network, log, drive=drive, surroundings=surroundings_of(stored.files))
    return write_animation(record, case.network, log, drive=drive, image_format=replay_format)


def _outcome(case: Case, ego: int, log: SimulationLog) -> str:
    """The outcome of a drive, in words."""
    metrics = measure(case, ego, log)
    outcome = outcome_of(metrics)
    if outcome is DriveOutcome.AVOIDED:
        return "avoided, nobody touches anybody"
    new, old = (mps_to_mph(each) for each in (metrics.delta_v_mps, metrics.recorded_delta_v_mps))
    return f"{outcome}, delta-v {new:.0f} mph where {old:.0f} mph was recorded"
