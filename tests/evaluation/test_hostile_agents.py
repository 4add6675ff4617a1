"""An agent that does what no agent should costs its own run and nothing else, and says so in a line."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest
from waiting import eventually

from tests.evaluation.cases import drive, rear_end
from trace_dag.errors import UserError
from trace_dag.evaluation.agent_code import agent_code
from trace_dag.evaluation.agent_main import AgentLimits
from trace_dag.evaluation.agent_process import AgentProcess
from trace_dag.evaluation.evaluate import Evaluation
from trace_dag.evaluation.isolation import Isolation, isolation
from trace_dag.evaluation.metrics import DriveOutcome
from trace_dag.processes import descendants

LIMITS = AgentLimits(time_s=3.0, memory_mb=512, processes=8, files=64, file_mb=8, output_kb=256)
MODULE = "tests.evaluation.hostile_agents"


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    before = len(descendants(os.getpid()))
    yield
    eventually(lambda: len(descendants(os.getpid())) <= before + 1, "a process was left")  # the nursery stays


def driven(name: str, around: Isolation | None = None, **arguments: str) -> Evaluation:
    asked = "&".join(f"{key}={quote(value)}" for key, value in arguments.items())
    agent = AgentProcess(f"{MODULE}:{name}{'?' if asked else ''}{asked}", LIMITS, around)
    try:
        return drive(rear_end(), agent)
    finally:
        agent.close()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Interrupting", "KeyboardInterrupt"),
        ("Looping", "took longer than 3 s"),
        ("Deaf", "took longer than 3 s"),
        ("Bomb", "started more than the 8 processes that are allowed"),
        ("Talkative", "printed more than 256 kB"),
        ("Hungry", "MemoryError"),
        ("Writing", "OSError: [Errno 27] File too large"),
        ("Opening", "OSError: [Errno 24] Too many open files"),
        ("Leaving", "ended its process (exit code 3)"),
        ("HangingUp", "closed its channel"),
        ("Pickling", "answered bytes that are not an answer"),
        ("Flooding", "answered bytes that are not an answer"),
        ("TwoAtOnce", "answered bytes that are not an answer"),
        ("Drawing", "ValueError: ?[2J?[H all is well!"),
        ("Unshowable", "Shy: cannot be shown, SystemExit"),
    ],
)
def test_what_no_agent_should_do_is_its_fault_in_a_line(name: str, said: str) -> None:
    found = driven(name)
    assert found.outcome is DriveOutcome.FAULTY
    assert said in found.fault
    assert found.fault.isprintable()
    assert len(found.fault) < 500
    assert not Path("/tmp/agent-was-unpickled").exists()


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("Motion(path_m=np.array([1.0, 2.0]))", "shape (n, 2)"),
        ("Motion(path_m=[[0, 0], [1, 1]])", "shape (n, 2)"),
        ("Motion(path_m=np.zeros((10**6, 2)))", "at most 10000"),
        ("Motion(path_m=np.array([[0.0, 0.0], [1e300, 1.0]]))", "1000 km away"),
        ("Motion(path_m=np.zeros((3, 2)))", "two points or more"),
        ("Motion(target_speed_mps=10**400)", "beyond any float"),
        ("Motion(acceleration_mps2=nan)", "is nan"),
        ("Motion(steer_rad=1j)", "is complex"),
        ("Pedals(throttle=None)", "Pedals.throttle is NoneType"),
        ("Pedals(reverse='yes')", "Pedals.reverse is str"),
        ("[1, 2]", "answered list"),
    ],
)
def test_an_answer_that_is_none_is_named(answer: str, said: str) -> None:
    found = driven("Answering", answer=answer)
    assert found.outcome is DriveOutcome.FAULTY
    assert said in found.fault


def test_who_patches_what_measures_changes_nothing_but_itself() -> None:
    assert driven("Patching").outcome is driven("Harmless").outcome is DriveOutcome.SAME


def test_a_path_changed_in_place_is_a_new_path() -> None:
    import numpy as np

    from trace_dag.evaluation.agents import Motion
    from trace_dag.evaluation.wire import AnswerReader, AnswerWriter

    path, writer, reader = np.array([[0.0, 0.0], [9.0, 0.0]]), AnswerWriter(), AnswerReader()
    first = reader.from_bytes(writer.to_bytes(Motion(path_m=path)))
    same = reader.from_bytes(writer.to_bytes(Motion(path_m=path.copy())))
    path[1, 1] = 5.0
    other = reader.from_bytes(writer.to_bytes(Motion(path_m=path)))
    assert isinstance(first, Motion)
    assert isinstance(same, Motion)
    assert isinstance(other, Motion)
    assert first.path_m is same.path_m
    assert other.path_m is not None
    assert other.path_m.tolist() == [[0.0, 0.0], [9.0, 5.0]]


def test_results_tell_an_agent_whose_code_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = tmp_path / "weights.bin"
    weights.write_bytes(b"1")
    first = agent_code(f"{MODULE}:Harmless?weights={quote(str(weights))}")
    weights.write_bytes(b"2")
    assert agent_code(f"{MODULE}:Harmless?weights={quote(str(weights))}") != first
    (tmp_path / "broken_agent.py").write_text("class :")
    monkeypatch.syspath_prepend(tmp_path)
    assert agent_code("broken_agent:Agent") == "unread"


# --- isolated -----------------------------------------------------------------------------------------------------
@pytest.fixture
def around(tmp_path: Path) -> Isolation:
    (tmp_path / "root").mkdir()
    (tmp_path / "root" / "secret").write_text("of others")
    try:
        return isolation(str(tmp_path / "root"))
    except UserError as error:
        pytest.skip(str(error))


def test_an_isolated_agent_reaches_nothing(around: Isolation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AGENTS_MUST_NOT_SEE", "a key")
    secret = str(tmp_path / "root" / "secret")
    assert "could read write" in driven("Curious", secret=secret).fault
    (Path(__file__).parent / "written-by-agent").unlink()
    assert "could nothing" in driven("Curious", around, secret=secret).fault


def test_an_isolated_agent_drives_as_any_other(around: Isolation) -> None:
    assert driven("Harmless", around) == driven("Harmless")


def test_isolated_agents_end_as_others_do(around: Isolation) -> None:
    assert "exit code 3" in driven("Leaving", around).fault
    assert "that are allowed" in driven("Bomb", around).fault


def test_a_system_without_namespaces_is_said_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(UserError, match=r"--isolate needs unshare and mount .* of util-linux"):
        isolation("another")
