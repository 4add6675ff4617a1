"""Evaluations per minute: the baselines in the bundled sample's verified crashes, as trace-dag evaluate runs them; and
what it costs that each agent has a process of its own: the same evaluations with the agent in this process; and how
many times as fast as real time the agent idm is driven beside each kind of traffic.

    python -m benchmarks.evaluating [ROOT]

ROOT is a storage root whose crashes have been run; without one the sample is run first.
"""

from __future__ import annotations

import ctypes
import os
import resource
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from trace_dag.evaluation.agent_main import AgentLimits
from trace_dag.evaluation.agent_process import AgentProcess
from trace_dag.evaluation.agents import Agent
from trace_dag.evaluation.evaluate import Conditions, evaluate, run
from trace_dag.evaluation.registry import BASELINES, make_agent, resolve
from trace_dag.evaluation.traffic import Traffic
from trace_dag.flow.executors import available_cores
from trace_dag.flow.workspace import Workspace
from trace_dag.processes import descendants
from trace_dag.sim.backends import backend
from trace_dag.studies.cases import AgentRole, StoredCase, load_case, number_of, verified_cases
from trace_dag.studies.evaluation_work import EvaluationWork, LoadedCase
from trace_dag.studies.evaluations import evaluate_agents

ROLES = (AgentRole.FIRST, AgentRole.SECOND)


def _take_in_orphans() -> None:
    """Be the parent of processes whose own has ended, so that their processor time counts (prctl(2), 36)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(36, 1)


def _processor_of(agent: AgentProcess) -> float:
    """Processor time that an agent's processes have used (s), of proc(5)."""
    life = agent._life
    assert life is not None
    ticks = 0
    for number in (life.process.pid, *descendants(life.process.pid)):
        fields = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
        ticks += sum(map(int, fields[11:13]))
    return ticks / os.sysconf("SC_CLK_TCK")


def _drive(work: EvaluationWork, loaded: list[LoadedCase], agents: Mapping[str, Agent]) -> int:
    done = 0
    for shared in loaded:
        for agent in agents.values():
            for role in ROLES:
                evaluate(shared.case, number_of(shared.case, role), agent, work.conditions, shared.simulation)
                done += 1
    return done


def _cost_of_processes(workspace: Workspace, cases: Sequence[StoredCase]) -> None:
    """Print the processor time of the same evaluations, agents here and agents in processes of their own."""
    by_id = {case.case_id: case for case in cases}
    work = EvaluationWork(workspace.settings.sim, by_id, Conditions(), AgentLimits(), None)
    loaded = [work.prepare(name) for name in by_id]
    references = {name: resolve(name) for name in BASELINES}
    here = {name: make_agent(reference) for name, reference in references.items()}
    apart = {name: AgentProcess(reference, work.limits) for name, reference in references.items()}
    _drive(work, loaded[:1], here)
    _drive(work, loaded[:1], apart)  # starts them
    began_s = time.process_time()
    done = _drive(work, loaded, here)
    here_s = time.process_time() - began_s
    before = {name: _processor_of(process) for name, process in apart.items()}
    began_s = time.process_time()
    _drive(work, loaded, apart)
    agents_s = sum(_processor_of(process) - before[name] for name, process in apart.items())
    apart_s = time.process_time() - began_s + agents_s
    for process in apart.values():
        process.close()
    print(f"{done} evaluations with agents in this process: {here_s:.1f} s of processor time")
    print(
        f"{done} with each in its own: {apart_s:.1f} s, {agents_s:.1f} s of it of agents; {apart_s / here_s - 1:+.1%}"
    )


def _times_real_time(workspace: Workspace, cases: Sequence[StoredCase]) -> None:
    """Print simulated seconds per second of processor time of one core, with the agent idm in this process."""
    agent = make_agent(resolve("idm"))
    simulated_s, busy_s = dict.fromkeys(Traffic, 0.0), dict.fromkeys(Traffic, 0.0)
    for stored in cases:
        case = load_case(stored)
        simulation = backend(workspace.settings.sim).load(case.network, case.xodr, friction=case.friction)
        for ego in sorted({number_of(case, role) for role in ROLES}):
            run(case, ego, agent, Conditions(), simulation, after_contact_s=0.5)  # the route is found once for all
            for traffic in Traffic:
                began_s = time.process_time()
                log = run(case, ego, agent, Conditions(traffic=traffic), simulation, after_contact_s=0.5)
                busy_s[traffic] += time.process_time() - began_s
                simulated_s[traffic] += log.duration_s
    for traffic in Traffic:
        print(f"idm beside {traffic} traffic: {simulated_s[traffic] / busy_s[traffic]:.0f} times real time")


def main() -> None:
    """Print how many evaluations a minute the machine makes, by the clock and by processor time."""
    if len(sys.argv) > 1:
        root = sys.argv[1]
    else:
        from trace_dag.cli.main import cli

        root = tempfile.mkdtemp(prefix="trace-dag-evaluating-")
        cli.main(["--root", root, "demo"], standalone_mode=False)
    _take_in_orphans()
    workspace = Workspace.open(root)
    cases = verified_cases(workspace, None, ())
    began = time.perf_counter()
    rows = evaluate_agents(workspace, cases, BASELINES, ROLES, Conditions(), AgentLimits())
    took_s = time.perf_counter() - began
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:  # agents' processes, whose workers have ended before them
            pass
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy_s = used.ru_utime + used.ru_stime
    cores = available_cores()
    print(f"{len(rows)} evaluations of {len(cases)} crashes by {len(BASELINES)} agents on {cores} cores")
    print(f"{60 * len(rows) / took_s:.0f} a minute by the clock ({took_s:.1f} s)")
    print(f"{60 * len(rows) * cores / busy_s:.0f} a minute by processor time of workers and agents ({busy_s:.1f} s)")
    _times_real_time(workspace, cases)
    if sys.platform == "linux":
        _cost_of_processes(workspace, cases)


if __name__ == "__main__":
    main()
