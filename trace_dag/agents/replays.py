"""Crashes to watch: as they were simulated, or with an agent in a driver's place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.agent_process import AgentProcess
from trace_dag.agents.evaluation.agents import AgentFault
from trace_dag.agents.evaluation.evaluate import Conditions, run
from trace_dag.agents.evaluation.metrics import DriveOutcome, Metrics, measure, outcome_of
from trace_dag.agents.evaluation.registry import resolve
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.stored_cases import AgentRole, number_of, stored_case
from trace_dag.agents.stored_traffic import StoredTraffic, load_driven, read_traffic
from trace_dag.common.errors import UserError
from trace_dag.common.units import mps_to_mph
from trace_dag.flow.artefacts import RECORD, ROAD_MAP, SAMPLED, VERDICT, CrashArtefacts, surroundings_of
from trace_dag.flow.workspace import Workspace
from trace_dag.pages.drive import AgentDrive
from trace_dag.scenario.cases import Case
from trace_dag.simulation.run import backend
from trace_dag.simulation.types import Simulation, SimulationLog

if TYPE_CHECKING:
    from trace_dag.pages.replay_content import ReplayContent

ReplayFormat = Literal["html", "glb", "webp"]


def replay(crash: CrashArtefacts, replay_format: ReplayFormat) -> bytes:
    """Return the replay of one stored crash: a page, a moving picture, or glTF in three dimensions.

    Raises :class:`UserError` for a crash that was not simulated.
    """
    from trace_dag.pages.animation import write_animation
    from trace_dag.pages.replay import replay_page
    from trace_dag.pages.solid.scene import crash_glb

    log = crash.shown_log()
    if log is None:
        raise UserError(f"crash {crash.key} was not simulated; trace-dag status shows its state")
    if replay_format == "html":
        return replay_page(content_of(crash, log, read_traffic(crash)))
    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    verdict = crash.load(VERDICT) if crash.has(VERDICT) else None
    surroundings = surroundings_of(crash)
    if replay_format == "glb":
        return crash_glb(record.key, network, log, surroundings=surroundings)
    return write_animation(record, network, log, verdict, surroundings=surroundings)


def content_of(crash: CrashArtefacts, log: SimulationLog, traffic: StoredTraffic | None = None) -> ReplayContent:
    """Return the content of a replay of a stored crash, from one of its logs and the traffic made for it."""
    from trace_dag.pages.replay_content import replay_content

    verdict = crash.load(VERDICT) if crash.has(VERDICT) else None
    return replay_content(
        crash.load(RECORD),
        crash.load(ROAD_MAP),
        log,
        verdict,
        surroundings=surroundings_of(crash),
        sampled=crash.load(SAMPLED) if crash.has(SAMPLED) else None,
        traffic=None if traffic is None else traffic.traffic,
    )


def replay_with(
    workspace: Workspace,
    case_id: str,
    agents: Sequence[str],
    role: AgentRole,
    traffic: Traffic,
    replay_format: ReplayFormat,
) -> bytes:
    """Return the replay of a verified crash, variation or likely course with an agent as a driver.

    The conditions are the default ones. Several agents drive one by one and are shown side by side on a page. Raises
    :class:`UserError` for a crash that is not verified, an unknown or faulty agent, and several agents in a moving
    picture.
    """
    from trace_dag.pages.animation import write_animation
    from trace_dag.pages.replay import replay_page, write_html_pair
    from trace_dag.pages.replay_content import replay_content
    from trace_dag.pages.solid.scene import crash_glb

    if len(agents) > 1 and replay_format != "html":
        raise UserError(f"--format {replay_format} shows one agent; several beside each other need --format html")
    stored = stored_case(workspace, case_id)
    case = load_driven(stored, traffic)
    simulation = backend(workspace.settings.sim).load(case.network, case.xodr, friction=case.friction)
    driven = [_driven(case, number_of(case, role), agent, traffic, simulation) for agent in agents]
    record, surroundings = stored.files.load(RECORD), surroundings_of(stored.files)
    if len(driven) > 1:
        return write_html_pair(record, case.network, driven, surroundings=surroundings)
    ((drive, log),) = driven
    if replay_format == "html":
        return replay_page(replay_content(record, case.network, log, drive=drive, surroundings=surroundings))
    if replay_format == "glb":
        return crash_glb(record.key, case.network, log, drive, surroundings=surroundings)
    return write_animation(record, case.network, log, drive=drive, surroundings=surroundings)


_NOBODY_TOUCHED = {
    DriveOutcome.CONFLICT_AVOIDED: "conflict avoided, nobody touches anybody",
    DriveOutcome.COLLISION_AVOIDED: "collision avoided in the conflict, nobody touches anybody",
    DriveOutcome.DID_NOT_ARRIVE: "did not get past the conflict",
    DriveOutcome.RULES_BROKEN: "nobody touches anybody, but off the road or too fast",
}


def _driven(
    case: Case, ego: int, agent: str, traffic: Traffic, simulation: Simulation
) -> tuple[AgentDrive, SimulationLog]:
    driver = AgentProcess(resolve(agent), AgentLimits())
    try:
        log = run(case, ego, driver, Conditions(traffic=traffic), simulation)
    except AgentFault as fault:
        raise UserError(f"--agent {agent} is faulty in {case.key}: {fault}") from fault
    finally:
        driver.close()
    return AgentDrive(agent, ego, _outcome(case, ego, log), case.recorded), log


def _outcome(case: Case, ego: int, log: SimulationLog) -> str:
    """Return a sentence on the outcome of a drive, with the variation or course if it is one."""
    said = _in_words(case, measure(case, ego, log))
    return said if case.case_id == case.key else f"{said}, in {case.case_id}"


def _in_words(case: Case, metrics: Metrics) -> str:
    outcome = outcome_of(metrics, departed=case.departed is not None)
    if case.departed is not None and outcome is DriveOutcome.CONFLICT_AVOIDED:
        return "avoided, the vehicle stays on the road"
    if outcome in _NOBODY_TOUCHED:
        return _NOBODY_TOUCHED[outcome]
    new, old = (mps_to_mph(each) for each in (metrics.delta_v_mps, metrics.recorded_delta_v_mps))
    return f"{outcome}, delta-v {new:.0f} mph where {old:.0f} mph was recorded"
