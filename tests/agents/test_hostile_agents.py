"""An agent that does what no agent should costs its own run and nothing else, and says so in a line."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from waiting import eventually

from tests.agents.cases import drive, rear_end
from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.agent_process import AgentProcess
from trace_dag.agents.evaluation.agent_protocol import answer_from_bytes, answer_to_bytes
from trace_dag.agents.evaluation.agents import AgentFault, Motion
from trace_dag.agents.evaluation.evaluate import Evaluation
from trace_dag.agents.evaluation.isolation import Isolation, isolation
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation_work import agent_code
from trace_dag.common.errors import UserError
from trace_dag.common.processes import descendants

LIMITS = AgentLimits(time_s=60.0, memory_mb=512, processes=8, files=64, file_mb=8, output_kb=256)
MODULE = "tests.agents.hostile_agents"
ENDLESS = ("Looping", "Deaf")  # for these alone time is short: a busy machine would make others late too


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    before = len(descendants(os.getpid()))
    yield
    eventually(lambda: len(descendants(os.getpid())) <= before, "a process was left")


def driven(name: str, around: Isolation | None = None, **arguments: str) -> Evaluation:
    asked = "&".join(f"{key}={quote(value)}" for key, value in arguments.items())
    limits = replace(LIMITS, time_s=3.0) if name in ENDLESS or arguments.get("then") == "loop" else LIMITS
    agent = AgentProcess(f"{MODULE}:{name}{'?' if asked else ''}{asked}", limits, around)
    try:
        return drive(rear_end(), agent)
    finally:
        agent.close()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Interrupting", "KeyboardInterrupt"),
        ("Looping", "took longer than 3 s of processor time"),
        ("Deaf", "took longer than 15 s"),
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
def test_misbehaviour_is_the_agents_fault_in_a_line(name: str, said: str) -> None:
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


def test_an_agent_patching_the_measures_changes_only_its_own_process() -> None:
    assert driven("Patching").outcome is driven("Harmless").outcome is DriveOutcome.UNCHANGED


def test_an_agent_that_stops_its_parent_stops_nobody_who_measures() -> None:
    assert driven("Stopping").outcome is DriveOutcome.UNCHANGED
    assert "took longer than 3 s" in driven("Stopping", then="loop").fault


def test_an_agent_ends_with_the_process_that_measures() -> None:
    code = """
import os, threading, time
from tests.agents.test_hostile_agents import driven
from trace_dag.common.processes import descendants

def end_with_its_agent():
    while len(found := tuple(descendants(os.getpid()))) < 2:
        time.sleep(0.05)
    print(*found, flush=True)
    os.kill(os.getpid(), 9)

threading.Thread(target=end_with_its_agent).start()
driven("Looping")
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    agents = [Path(f"/proc/{number}") for number in done.stdout.split()]
    assert len(agents) == 2, done.stderr
    eventually(lambda: not any(agent.exists() for agent in agents), "an agent outlived who measures")


def test_a_path_arrives_as_it_was_answered_and_anything_else_is_a_fault() -> None:
    path = np.array([[0.0, 0.1], [9.0, -1.0 / 3.0]])
    answer = answer_from_bytes(answer_to_bytes(Motion(target_speed_mps=np.float32(2.5), path_m=path)))
    assert isinstance(answer, Motion)
    assert (answer.target_speed_mps, answer.acceleration_mps2) == (2.5, None)
    assert answer.path_m is not None
    assert np.array_equal(answer.path_m, path)
    for data in (b"", b"{}", b"[" * 100_000, b'{"pedals": 1}', b'{"motion": {}}', b'{"fault": {}}', b'{"recorded": 0}'):
        with pytest.raises(AgentFault, match="not an answer"):
            answer_from_bytes(data)


def test_results_tell_an_agent_whose_code_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = tmp_path / "weights.bin"
    weights.write_bytes(b"1")
    first = agent_code(f"{MODULE}:Harmless?weights={quote(str(weights))}")
    weights.write_bytes(b"2")
    assert agent_code(f"{MODULE}:Harmless?weights={quote(str(weights))}") != first
    changing = tmp_path / "changing_agent.py"
    changing.write_text("class Agent: ...")
    monkeypatch.syspath_prepend(tmp_path)
    before = agent_code("changing_agent:Agent")
    changing.write_text("class Agent: speed = 1")
    assert agent_code("changing_agent:Agent") != before
    assert agent_code("no_such_agent:Agent") == "unread"


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


def test_an_isolated_agent_makes_no_namespace_of_its_own(around: Isolation) -> None:
    assert "unshare: 0" in driven("Unsharing").fault, "this machine allows it"
    assert "unshare: 28" in driven("Unsharing", around).fault, "ENOSPC: the limit of namespaces is reached"


def test_isolated_agents_end_as_others_do(around: Isolation) -> None:
    assert "exit code 3" in driven("Leaving", around).fault
    assert "that are allowed" in driven("Bomb", around).fault


def test_a_system_without_namespaces_is_reported_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(UserError, match=r"--isolate needs unshare and mount .* of util-linux"):
        isolation("another")
