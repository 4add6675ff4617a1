"""What no crash could be done without is said before any is worked on."""

from __future__ import annotations

import socket

import pytest
from sample_runs import KEYS, ingest, reports_of, trace_dag

from trace_dag.errors import UserError
from trace_dag.flow.batch import check_requirements, run_stages
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage


@pytest.fixture
def silent_port() -> int:
    """A port of this machine that nothing listens at."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


def opened(tmp_path, **sections) -> Workspace:
    return Workspace.open(str(tmp_path / "root"), FLOW, sections)


def test_without_a_carla_server_no_run_begins(tmp_path, silent_port):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    workspace = opened(tmp_path, sim={"backend": "carla", "carla_port": silent_port})
    with pytest.raises(UserError, match=f"no CARLA server answers at 127.0.0.1:{silent_port}"):
        list(run_stages(workspace, ["2023-1"], run_id="a run"))


def test_a_listening_server_is_enough_to_begin(tmp_path):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        check_requirements(opened(tmp_path, sim={"backend": "carla", "carla_port": server.getsockname()[1]}), Stage)


def test_stages_that_are_not_run_require_nothing(tmp_path, silent_port):
    workspace = opened(tmp_path, sim={"backend": "carla", "carla_port": silent_port})
    check_requirements(workspace, [Stage.ROAD_MAP, Stage.VERDICT])


def test_workers_of_a_cluster_have_their_own(tmp_path, silent_port):
    sections = {"sim": {"backend": "carla", "carla_port": silent_port}, "execution": {"executor": "dask"}}
    check_requirements(opened(tmp_path, **sections), Stage)


def test_a_converter_that_is_not_installed_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"pip install 'trace-dag\[carla\]'"):
        check_requirements(opened(tmp_path, roads={"converter": "osm2odr"}), [Stage.ROAD_MAP])


def test_the_command_says_it_in_one_line_and_leaves_nothing_behind(tmp_path, silent_port):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    root = tmp_path / "root"
    ingest(root, reports_of(tmp_path / "reports", KEYS[:1]))
    done = trace_dag(root, "run", TRACE_DAG_SIM__BACKEND="carla", TRACE_DAG_SIM__CARLA_PORT=str(silent_port))
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "no CARLA server answers" in done.stderr
    assert not (root / "raw_report").exists()
