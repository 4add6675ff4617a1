"""Evaluations by the workers of a Dask cluster are those of this machine, and a worker that is lost loses none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import sample_runs

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.table import Row
from trace_dag.agents.evaluations import evaluate_agents
from trace_dag.agents.stored_cases import AgentRole, verified_cases
from trace_dag.common.errors import Failure
from trace_dag.flow.workspace import Workspace

CRASHES = ("2023-319003", "2023-319022")
ROLES = (AgentRole.FIRST, AgentRole.SECOND)
LIMITS = AgentLimits(time_s=60.0)

# Whoever replays, and ends the cluster's worker, which is the parent of the process that forks agents, the first time.
AGENTS = """
import os, pathlib, signal
from trace_dag.agents.evaluation.baselines import Replay

class Deadly(Replay):
    def __init__(self, folder):
        super().__init__()
        self.mark = pathlib.Path(folder, "killed")
    def reset(self, scenario):
        if not self.mark.exists():
            self.mark.touch()
            status = pathlib.Path(f"/proc/{os.getppid()}/status").read_text()
            os.kill(int(status.partition("PPid:")[2].split()[0]), signal.SIGKILL)
        super().reset(scenario)
"""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Two workers as Dask starts them by itself: daemons, which may have no processes of multiprocessing's."""
    distributed = pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("agents")
    (folder / "cluster_agents.py").write_text(AGENTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as made:
            yield made.scheduler_address


def evaluated(root: Path, agents: tuple[str, ...], **execution: object) -> list[Row]:
    workspace = Workspace.open(str(root), overrides={"execution": execution})
    cases = verified_cases(workspace, None, CRASHES)
    return evaluate_agents(workspace, cases, agents, ROLES, Conditions(), LIMITS)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return sample_runs.copy_finished(tmp_path / "root")


def test_a_cluster_gives_the_rows_of_this_machine(cluster: str, root: Path) -> None:
    here = evaluated(root, ("replay", "brake"), workers=1)
    assert len(here) == len(CRASHES) * len(ROLES) * 2
    assert evaluated(root, ("replay", "brake"), executor="dask", dask_address=cluster) == here


def test_a_worker_that_is_lost_loses_no_evaluation(cluster: str, root: Path, tmp_path: Path) -> None:
    mark = tmp_path / "killed"  # no file that the argument names: its content would be a version of the agent
    agent = f"cluster_agents:Deadly?folder={tmp_path}"
    there = evaluated(root, (agent,), executor="dask", dask_address=cluster)
    assert mark.exists(), "a worker was killed"
    assert {row["fault"] for row in there} == {None}
    assert evaluated(root, (agent,), workers=1) == there


def test_a_worker_with_another_version_of_an_agent_refuses_the_work(
    cluster: str, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "only_here.py").write_text("from trace_dag.agents.evaluation.baselines import Replay\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(Failure, match=r"agent only_here:Replay: this worker has code .*; update the workers"):
        evaluated(root, ("only_here:Replay",), executor="dask", dask_address=cluster)
