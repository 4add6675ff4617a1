"""Budget and rate of a run, over every process that asks for it."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict

import pytest
from cases import sample_case
from llm_asking import HEAD_ON, LEFT_TURN, by_model
from loopback import serving
from model_server import COST_USD, KEY, knowing, llm_settings

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.checksums import add_checksum
from trace_dag.common.storage.files import Storage
from trace_dag.language.hypotheses import llm_client
from trace_dag.language.ledger import FOLDER, Page, SpendingLedger
from trace_dag.simulation.states import StateEstimate


class Time:
    """A clock that moves when somebody sleeps."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.slept: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now_s += seconds

    def clock(self) -> float:
        return self.now_s


def ledgers(files: Storage, count: int, time: Time | None = None, **changes: object) -> list[SpendingLedger]:
    """The ledgers of several processes of one run."""
    time = time or Time()
    return [SpendingLedger(files=files, sleep=time.sleep, clock=time.clock, **changes) for _ in range(count)]


@pytest.fixture(params=["a folder", "an object store"])
def files(request, tmp_path) -> Storage:
    return Storage(tmp_path) if request.param == "a folder" else Storage(f"memory://{tmp_path.name}")


def test_requests_keep_the_rate_over_all_processes(files):
    time = Time()
    both = ledgers(files, 2, time, requests_per_minute=30.0)
    for number in range(4):
        both[number % 2].reserve()
    assert time.slept == pytest.approx([2.0, 2.0, 2.0])


def test_the_longest_waiting_vehicle_goes_first(files):
    time = Time()
    (two,) = ledgers(files, 1, time, requests_per_minute=60.0)
    waiting = Page("another process", waiting_since_s=time.now_s - 0.5)  # it is about to take its turn
    files.write(f"{FOLDER}/run/another.json", add_checksum(json.dumps(asdict(waiting)).encode()))
    two.reserve()
    assert time.slept == pytest.approx([1.0])
    time.now_s += 100.0  # and died before it did
    two.reserve()
    assert len(time.slept) == 1


def test_the_budget_is_that_of_all_processes(files):
    one, two = ledgers(files, 2, budget_usd=0.5, requests_per_minute=1e6)
    for ledger in (one, two):
        ledger.reserve()
        ledger.charge(0.3)
    assert one.spent_usd() == two.spent_usd() == pytest.approx(0.6)
    with pytest.raises(Failure, match=r"budget of 0\.5 USD.*0\.6000"):
        one.reserve()
    (another_run,) = ledgers(files, 1, budget_usd=0.5, name="another")
    another_run.reserve()


def test_a_silent_provider_is_left_alone_for_a_while(files):
    time = Time()
    one, two = ledgers(files, 2, time, requests_per_minute=1e6)
    for ledger in (one, two, one):
        ledger.reserve()
        ledger.unanswered()
    with pytest.raises(TransientFailure, match="3 questions in a row unanswered"):
        two.reserve()
    time.now_s += 61.0
    two.reserve()
    two.charge(0.0)
    one.reserve()
    one.charge(0.0)
    two.reserve()


SPENDING = """
import sys
from trace_dag.common.errors import Failure
from trace_dag.language.ledger import SpendingLedger
from trace_dag.common.storage.files import Storage
ledger = SpendingLedger(0.5, 1e9, Storage(sys.argv[1]))
try:
    while True:
        ledger.reserve()
        ledger.charge(0.01)
except Failure:
    pass
"""


def test_processes_that_spend_at_once_stop_at_the_budget(tmp_path):
    running = [subprocess.Popen([sys.executable, "-c", SPENDING, str(tmp_path)]) for _ in range(3)]
    assert [process.wait(60) for process in running] == [0, 0, 0]
    spent = SpendingLedger(files=Storage(tmp_path)).spent_usd()
    assert 0.5 <= spent <= 0.5 + 3 * 0.01 + 1e-9
    assert len(list((tmp_path / FOLDER / "run").iterdir())) == 3


def test_the_budget_ends_a_batch_in_the_middle_and_a_later_run_goes_on(monkeypatch, tmp_path):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    one, two = (sample_case(key) for key in (HEAD_ON, LEFT_TURN))
    files = Storage(tmp_path)

    def run(case, chosen: StateSettings, ledger: str) -> StateEstimate:
        client = llm_client(chosen, files=files, ledger=ledger)
        return by_model(case, chosen, client)

    with serving(knowing([one, two])) as server:
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        tight = llm_settings(llm_budget_usd=COST_USD / 2)
        assert run(one, tight, "run-1").run.cost_usd == pytest.approx(COST_USD)
        with pytest.raises(Failure, match="budget"):
            run(two, tight, "run-1")
        # What is stored is free, so the first crash goes through even with nothing left.
        assert not run(one, tight, "run-1").run.fallback
        assert len(server.requests) == 1
        assert run(two, tight, "run-2").run.attempts == 1
        # Runs that name the same ledger share its budget.
        shared = llm_settings(llm_budget_usd=COST_USD / 2, llm_ledger="run-2", llm_model="openai/gpt-4.1")
        with pytest.raises(Failure, match="budget"):
            run(two, shared, "run-3")
