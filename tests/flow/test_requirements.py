"""What no crash could be done without is said before any is worked on."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from pathlib import Path

import pytest
from model_server import KEY, MODEL
from sample_runs import KEYS, ingest, reports_of, trace_dag

from trace_dag.common.errors import UserError
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import check_requirements, run_stages
from trace_dag.flow.cohorts import ingest as cohorts
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace


@pytest.fixture
def silent_port() -> int:
    """A port of this machine that nothing listens at."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


def opened(tmp_path, **sections) -> Workspace:
    return Workspace.open(str(tmp_path / "root"), FLOW, sections)


def registered(workspace: Workspace, folder: Path) -> None:
    cohorts.ingest(workspace.storage, "sample", reports=[reports_of(folder / "reports", KEYS[:1])])


def lacking(workspace: Workspace, stages: Iterable[Stage]) -> str | None:
    """What the stages lack to begin, None if nothing."""
    try:
        check_requirements(workspace, stages)
    except UserError as error:
        return str(error)
    return None


def test_without_a_carla_server_no_run_begins(tmp_path, silent_port):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    workspace = opened(tmp_path, sim={"backend": "carla", "carla_port": silent_port})
    registered(workspace, tmp_path)
    with pytest.raises(UserError, match=f"no CARLA server answers at 127.0.0.1:{silent_port}"):
        list(run_stages(workspace, KEYS[:1], run_id="a-run"))


def test_a_listening_server_is_enough_to_begin(tmp_path):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        workspace = opened(tmp_path, sim={"backend": "carla", "carla_port": server.getsockname()[1]})
        assert lacking(workspace, Stage) is None


def test_stages_that_are_not_run_require_nothing(tmp_path, silent_port):
    workspace = opened(tmp_path, sim={"backend": "carla", "carla_port": silent_port})
    assert lacking(workspace, [Stage.ROAD_MAP, Stage.VERDICT]) is None
    assert lacking(workspace, [Stage.SIMULATION_LOG]) is not None


def test_workers_of_a_cluster_have_their_own(tmp_path, silent_port):
    sections = {"sim": {"backend": "carla", "carla_port": silent_port}, "execution": {"executor": "dask"}}
    assert lacking(opened(tmp_path, **sections), Stage) is None


def test_without_its_key_a_model_is_not_asked_and_no_run_begins(tmp_path, monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    workspace = opened(tmp_path, states={"estimator": "llm", "llm_model": MODEL})
    registered(workspace, tmp_path)
    with pytest.raises(UserError, match=f"{MODEL}: the environment lacks OPENAI_API_KEY"):
        list(run_stages(workspace, KEYS[:1], run_id="a-run"))
    assert not list((tmp_path / "root").rglob("*.outcome.json"))
    assert list(run_stages(workspace, KEYS[:1], [Stage.RAW_REPORT, Stage.CRASH_RECORD], run_id="no-estimates"))
    check_requirements(opened(tmp_path, states={"llm_model": MODEL}), Stage)


def test_an_unknown_prompt_is_named_before_the_model_is_asked(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    workspace = opened(tmp_path, states={"estimator": "llm", "llm_prompt": "best-v9"})
    with pytest.raises(UserError, match="no prompt is called 'best-v9'"):
        check_requirements(workspace, [Stage.STATE_ESTIMATE])


def test_a_model_server_that_is_not_there_is_reported_before_a_run(tmp_path, monkeypatch, silent_port):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("OPENAI_API_BASE", f"http://127.0.0.1:{silent_port}/v1")
    states = {"estimator": "llm", "llm_model": MODEL, "llm_provider_attempts": 1}
    with pytest.raises(UserError, match="the language model cannot be asked, so nothing is run"):
        check_requirements(opened(tmp_path, states=states), [Stage.STATE_ESTIMATE])


def test_a_converter_that_is_not_installed_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"pip install 'trace-dag\[carla\]'"):
        check_requirements(opened(tmp_path, roads={"converter": "osm2odr"}), [Stage.ROAD_MAP])


def test_the_command_reports_in_one_line_and_leaves_nothing_behind(tmp_path, silent_port):
    pytest.importorskip("carla", reason="the carla extra is not installed")
    root = tmp_path / "root"
    ingest(root, reports_of(tmp_path / "reports", KEYS[:1]))
    done = trace_dag(root, "run", TRACE_DAG_SIM__BACKEND="carla", TRACE_DAG_SIM__CARLA_PORT=str(silent_port))
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "no CARLA server answers" in done.stderr
    assert not (root / "raw_report").exists()
