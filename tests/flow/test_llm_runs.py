"""Runs with the LLM estimator, from reports to verdicts, against a loopback server that speaks OpenAI's protocol."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from cases import SAMPLE, sample_case
from loopback import Answer, Loopback, Request, serving
from model_server import COST_USD, KEY, MODEL, READY, Respond, asked_about, completion, failing, is_trial, knowing
from sample_runs import reports_of, study, trace_dag, trace_dag_process

from lab.estimator_rows import summarise
from lab.estimators import estimates_folder, estimators_compared, settings_of
from lab.truth.vehicles import load_truth
from trace_dag.common.errors import Reason, UserError
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.records import read_records
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.language.store import FOLDER as ANSWERS
from trace_dag.simulation.states import estimate_from_json
from trace_dag.warehouse.query import query

CRASHES = ("2023-319003", "2023-319022", "2023-319024", "2023-319029")
MAPPED = tuple(stage for stage in Stage if stage.position < Stage.STATE_ESTIMATE.position)
ESTIMATED = (Stage.STATE_ESTIMATE, Stage.SIMULATION_LOG, Stage.VERDICT)


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root on which some crashes have their maps."""
    folder = tmp_path_factory.mktemp("mapped")
    workspace = opened(folder / "root")
    ingest(workspace.storage, "sample", reports=[reports_of(folder / "reports", CRASHES)], maps=[SAMPLE / "osm"])
    list(run_stages(workspace, CRASHES, MAPPED, run_id="maps"))
    return folder / "root"


@pytest.fixture(scope="module")
def model() -> Respond:
    """A model that knows all of the crashes."""
    return knowing([sample_case(key) for key in CRASHES])


@pytest.fixture
def root(mapped: Path, tmp_path: Path) -> Path:
    return shutil.copytree(mapped, tmp_path / "root")


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Respond], Loopback]]:
    """Starts the server the environment names."""
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    running: list[Any] = []

    def start(respond: Respond, trial: Answer = READY) -> Loopback:
        context = serving(lambda request, before: trial if is_trial(request) else respond(request, before))
        server = context.__enter__()
        running.append(context)
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        return server

    yield start
    for context in running:
        context.__exit__(None, None, None)


def questions(server: Loopback) -> list[Request]:
    """What was asked about crashes."""
    return [request for request in server.requests if not is_trial(request)]


def opened(root: Path, *, workers: int = 1, **states: object) -> Workspace:
    """One worker is this process, which has read what a model is asked with; two are processes of their own."""
    overrides = {
        "execution": {
            "executor": "processes" if workers > 1 else "in_process",
            "workers": workers,
            "chunk_size": 1,
            "retry_wait_s": 0.0,
            "pictures": False,
        },
        "states": {"llm_model": MODEL, "llm_requests_per_minute": 1e6, **states},
    }
    return Workspace.open(str(root), FLOW, overrides)


def run(workspace: Workspace, run_id: str, **options: Any) -> dict[str, OutcomeRecord]:
    """The record of each crash's estimate after a run."""
    list(run_stages(workspace, CRASHES, ESTIMATED, run_id=run_id, **options))
    return {key: records[Stage.STATE_ESTIMATE] for key, records in read_records(workspace.storage, CRASHES).items()}


def estimate_bytes(workspace: Workspace) -> list[bytes]:
    return [workspace.storage.read(f"{Stage.STATE_ESTIMATE}/{key}.json") for key in CRASHES]


def test_a_run_is_verified_names_its_cost_and_costs_nothing_again(root, served, model):
    server = served(model)
    workspace = opened(root, estimator="llm")
    records = run(workspace, "first")
    assert {record.outcome for record in records.values()} == {Outcome.ACCEPTED}
    verdicts = [each[Stage.VERDICT].outcome for each in read_records(workspace.storage, CRASHES).values()]
    assert set(verdicts) == {Outcome.ACCEPTED}
    for record in records.values():
        assert record.figures["model"] == MODEL
        assert record.figures["cost_usd"] == pytest.approx(COST_USD)
    made = estimate_from_json(estimate_bytes(workspace)[0]).run
    assert (made.attempts, made.fallback, made.cost_usd) == (1, False, pytest.approx(COST_USD))
    assert json.loads(made.answers[0]["text"])["reasoning"] == "as reported"
    assert made.answers[0]["latency_s"] == made.latency_s > 0
    assert len(questions(server)) == len(CRASHES)

    before = estimate_bytes(workspace)
    run(workspace, "second")
    run(workspace, "forced", force=[Stage.STATE_ESTIMATE])
    assert estimate_bytes(workspace) == before
    assert len(questions(server)) == len(CRASHES)


def test_a_provider_that_fails_for_one_crash_fails_that_crash_and_a_later_run_mends_it(root, served, model):
    down = {CRASHES[0]}

    def respond(request: Request, before: int) -> Answer:
        return failing(503) if asked_about(request) in down else model(request, before)

    server = served(respond)
    workspace = opened(root, estimator="llm", llm_provider_attempts=1)
    records = run(workspace, "first")
    broken = records.pop(CRASHES[0])
    assert (broken.outcome, broken.transient, broken.attempts) == (Outcome.FAILED, True, 1)
    assert broken.detail.endswith("(asked once)")
    assert KEY not in broken.detail + broken.error
    assert {record.outcome for record in records.values()} == {Outcome.ACCEPTED}
    down.clear()
    assert run(workspace, "second")[CRASHES[0]].outcome is Outcome.ACCEPTED
    assert len(questions(server)) == len(CRASHES) + 1


def test_a_provider_that_is_down_does_not_hold_a_run_up(root, served):
    server = served(lambda *_: failing(500))
    records = run(opened(root, estimator="llm", llm_provider_attempts=1), "down")
    assert {(record.outcome, record.transient) for record in records.values()} == {(Outcome.FAILED, True)}
    assert len(questions(server)) == 3  # then it is left alone
    assert "left 3 questions in a row unanswered" in records[CRASHES[-1]].detail


@pytest.mark.parametrize("fallback", ["analytic", "reject"])
def test_unusable_answers_end_as_the_setting_states_and_are_kept(root, served, fallback):
    served(lambda *_: completion("I cannot tell."))
    workspace = opened(root, estimator="llm", llm_max_attempts=2, llm_fallback=fallback)
    record = run(workspace, "vague")[CRASHES[0]]
    assert (record.figures["attempts"], record.figures["cost_usd"]) == (2, pytest.approx(2 * COST_USD))
    if fallback == "analytic":
        assert record.outcome is Outcome.ACCEPTED
        assert (record.figures["estimator"], record.figures["fallback_from"]) == ("analytic", "llm")
        assert "gave no usable answer in 2 attempts" in record.figures["fallback_reason"]
        answers = estimate_from_json(estimate_bytes(workspace)[0]).run.answers
    else:
        assert (record.outcome, record.reason) == (Outcome.REJECTED, Reason.NO_FEASIBLE_STATE)
        answers = json.loads(workspace.storage.read(f"{Stage.STATE_ESTIMATE}/{CRASHES[0]}.answers.json"))["answers"]
    assert [answer["text"] for answer in answers] == ["I cannot tell."] * 2


def test_two_workers_stop_at_the_budget_and_a_later_run_goes_on(root, served, model):
    server = served(model)
    tight = opened(
        root, workers=2, estimator="llm", llm_budget_usd=1.5 * COST_USD
    )  # the question before the run costs too
    records = run(tight, "tight")
    paid = [key for key, record in records.items() if record.outcome is Outcome.ACCEPTED]
    assert 1 <= len(paid) == len(questions(server)) <= 2
    unpaid = [record for key, record in records.items() if key not in paid]
    assert all(record.outcome is Outcome.FAILED and "budget" in record.detail for record in unpaid)
    assert not any(record.transient for record in unpaid)
    later = run(opened(root, estimator="llm", llm_budget_usd=1.0), "later")
    assert {record.outcome for record in later.values()} == {Outcome.ACCEPTED}
    assert len(questions(server)) == len(CRASHES)


def test_the_command_leaves_no_key_anywhere(root, served, model):
    def respond(request: Request, before: int) -> Answer:
        return failing(401) if asked_about(request) == CRASHES[0] else model(request, before)

    served(respond)
    environment = {"TRACE_DAG_STATES__LLM_MODEL": MODEL, "TRACE_DAG_LOG": "DEBUG"}
    done = trace_dag_process(
        root, "run", "--estimator", "llm", "--executor", "in_process", "--only", *CRASHES[:2], **environment
    )
    assert done.returncode == 1, done.stderr
    assert "sorry, *** cannot be served" in done.stderr
    written = [path for path in root.rglob("*") if path.is_file()]
    assert any(path.suffix == ".db" for path in written), "Dagster's records"
    assert not [path for path in written if KEY.encode() in path.read_bytes()]
    assert KEY not in done.stdout + done.stderr


def test_estimates_that_are_not_the_models_are_distinguished_everywhere(root, served, model):
    vague = CRASHES[0]
    served(lambda request, before: completion("?") if asked_about(request) == vague else model(request, before))
    environment = {"TRACE_DAG_STATES__LLM_MODEL": MODEL, "TRACE_DAG_STATES__LLM_MAX_ATTEMPTS": "1"}
    done = trace_dag(root, "run", "--estimator", "llm", "--executor", "in_process", **environment)
    assert done.returncode == 0, done.stderr
    share = "4 estimates: 3 by llm, 1 by analytic in place of llm (25 %)"
    assert done.stdout.strip().splitlines()[-1] == share
    assert share in trace_dag(root, "status").stdout
    scored = json.loads(study(root, "score_truth", "--json").stdout)
    assert (scored["summary"]["estimators"], scored["summary"]["estimated"]) == (share, 3)
    assert scored["summary"]["fallbacks"] == 1
    rows = query(root / "warehouse.duckdb", "SELECT key, estimator, asked_estimator, fallback_reason FROM estimates")[1]
    by_key = {key: (made, asked, why) for key, made, asked, why in rows}
    why = by_key[vague][2]
    assert by_key[vague][:2] == ("analytic", "llm")
    assert f"{MODEL} gave no usable answer in 1 attempt;" in why
    assert by_key[CRASHES[1]] == ("llm", "llm", None)
    page = (root / "benchmark" / "crashes" / f"{vague}.html").read_text()
    assert "made by the analytic estimator, in place of the llm estimator: openai/gpt-4o gave no usable answer" in page
    assert (
        f"Estimated by the llm estimator ({MODEL})"
        in (root / "benchmark" / "crashes" / f"{CRASHES[1]}.html").read_text()
    )
    with zipfile.ZipFile(next((root / "benchmark").rglob(f"*{vague}*.zip"))) as package:
        (readme,) = [name for name in package.namelist() if name.endswith("README.md")]
        assert "analytic estimator, in place of the llm estimator" in package.read(readme).decode()
    assert trace_dag(root, "release", "--version", "0.1", "--output", str(root / "releases")).returncode == 0
    datasheet = next(root.rglob("DATASHEET.md")).read_text()
    assert "states estimated (llm: 3, analytic in place of llm: 1)" in datasheet


def contents(root: Path) -> dict[str, bytes]:
    """Everything a reader of the root sees: results, tables, pages."""
    folders = (*(stage.value for stage in Stage), "benchmark", "pictures")
    files = [path for folder in folders for path in (root / folder).rglob("*") if path.is_file()]
    return {str(path): path.read_bytes() for path in [*files, root / "warehouse.duckdb"]}


def test_a_provider_that_fails_takes_nothing_from_what_is_verified(root, served, model):
    environment = {"TRACE_DAG_STATES__LLM_MODEL": MODEL, "TRACE_DAG_STATES__LLM_PROVIDER_ATTEMPTS": "1"}
    ask = ("run", "--estimator", "llm", "--executor", "in_process")
    keys = CRASHES[:2]
    assert trace_dag(root, "run", "--executor", "in_process", "--only", *keys).returncode == 0
    before = contents(root)

    served(model, trial=failing(401))
    refused = trace_dag(root, *ask, "--only", *keys, **environment)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "AuthenticationError" in line
    assert contents(root) == before

    served(lambda request, nth: failing(503) if asked_about(request) == keys[0] else model(request, nth))
    done = trace_dag(root, *ask, "--only", *keys, **environment)
    assert done.returncode == 1
    assert f"outdated: {keys[0]} in state_estimate: the new attempt failed: {MODEL}" in done.stderr
    status = trace_dag(root, "status").stdout
    assert "2 verified" in status
    assert "1 of them outdated" in status
    row = "SELECT key, final_state, outdated, outdated_because LIKE '%asked once%' FROM crashes WHERE key IN"
    assert query(root / "warehouse.duckdb", f"{row} ('{keys[0]}', '{keys[1]}') ORDER BY key")[1] == [
        (keys[0], "verified", "state_estimate", True),
        (keys[1], "verified", None, None),
    ]
    assert query(root / "warehouse.duckdb", "SELECT key, final_state, stage FROM failures")[1] == [
        (keys[0], "verified", "state_estimate")
    ]
    page = (root / "benchmark" / "crashes" / f"{keys[0]}.html").read_text()
    assert "<b>Outdated:</b> its state estimate was to be made anew, which failed." in page
    assert not any(key in trace_dag(root, "verify").stdout for key in keys), "Dagster shows a failed attempt"


def test_estimators_are_set_side_by_side(root, served, model):
    def respond(request: Request, before: int) -> Answer:
        return completion("nonsense") if asked_about(request) == CRASHES[0] else model(request, before)

    served(respond)
    workspace = opened(root, llm_fallback="reject", llm_max_attempts=2)
    truth = load_truth(SAMPLE / "truth.json")
    heard: list[tuple[int, int]] = []
    rows = estimators_compared(
        workspace, "sample", ["analytic", "llm"], truth=truth, listener=lambda *done: heard.append(done)
    )
    assert heard[-1] == (len(CRASHES), len(CRASHES))
    assert [(row.key, row.estimator) for row in rows] == [
        (key, name) for key in CRASHES for name in ("analytic", "llm")
    ]
    analytic, llm = summarise(rows)
    assert (analytic.estimated, analytic.accepted, analytic.tokens) == (len(CRASHES), 1.0, 0)
    assert (llm.estimated, llm.rejected, llm.approach_agreement, llm.lane_agreement) == (len(CRASHES) - 1, 1, 1.0, 1.0)
    assert llm.cost_usd == pytest.approx((len(CRASHES) + 1) * COST_USD)
    assert llm.approach_correct is not None
    for name, key in (("analytic", CRASHES[0]), ("analytic", CRASHES[1]), ("llm", CRASHES[1])):
        stored = estimate_from_json(workspace.storage.read(f"{estimates_folder(name)}/{key}.json"))
        assert (stored.key, stored.run.estimator) == (key, name)
    assert not workspace.storage.exists(f"{estimates_folder('llm')}/{CRASHES[0]}.json")
    assert not workspace.storage.list(str(Stage.STATE_ESTIMATE)), "the flow's own artefacts are not touched"
    assert Storage(root / ANSWERS).list("") == {}  # answers lie in subfolders


def test_names_of_estimators(root):
    states = opened(root).settings.states
    chosen = settings_of("llm:coordinates-v1@ollama_chat/qwen3:8b", states)
    assert (chosen.estimator, chosen.llm_prompt, chosen.llm_model) == (
        "llm",
        "coordinates-v1",
        "ollama_chat/qwen3:8b",
    )
    assert settings_of("llm", states).llm_model == MODEL
    assert settings_of("analytic", states).estimator == "analytic"
    folders = {estimates_folder(name) for name in ("llm", "llm@a/b", "llm@a:b", "llm:a_b")}
    assert len(folders) == 4
    for wrong in ("best", "analytic@openai/gpt-4o", "llm:", ""):
        with pytest.raises(UserError, match="is not an estimator"):
            settings_of(wrong, states)
    with pytest.raises(UserError, match="two different"):
        estimators_compared(opened(root), "sample", ["llm", "llm"])
