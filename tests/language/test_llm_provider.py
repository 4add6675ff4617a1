"""What a provider does instead of answering, what is kept of its answers, and that its key is in none of it."""

from __future__ import annotations

import dataclasses
import json
import logging
import socket
import time

import pytest
from cases import Case, sample_case
from llm_asking import HEAD_ON, asking, by_model
from loopback import Answer, serving
from model_server import COST_USD, KEY, completion, failing, in_turn, llm_settings, right_answer

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.storage.files import Storage
from trace_dag.language.client import LlmClient
from trace_dag.language.hypotheses import llm_client
from trace_dag.simulation.states import estimate_to_json


@pytest.fixture(scope="module")
def case() -> Case:
    return sample_case(HEAD_ON)


@pytest.fixture(autouse=True)
def _key(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)


def test_429_is_waited_out_as_long_as_asked(monkeypatch, case):
    respond = in_turn(failing(429, **{"Retry-After": "7"}), completion(right_answer(case)))
    asked = asking(monkeypatch, case, respond)
    assert asked.slept == [7.0]
    assert asked.estimate.run.attempts == 1


NOT_A_COMPLETION = {"Content-Type": "application/json"}
PASSING = {
    "429": failing(429),
    "500": failing(500),
    "503": failing(503),
    "overloaded": failing(529),
    "a proxy's error page": Answer(b"<html>bad gateway</html>", status=520),
    "a page instead of an answer": Answer(b"<html>hello</html>"),
    "half an answer": Answer(b'{"id": ', headers=NOT_A_COMPLETION),
    "a torn connection": Answer(b'{"id": ', headers=NOT_A_COMPLETION, declared_length=1000),
}


@pytest.mark.parametrize("failure", PASSING)
def test_a_provider_that_keeps_failing_is_a_transient_failure(monkeypatch, case, failure):
    with pytest.raises(TransientFailure, match=r"^openai/gpt-4o: .*\(asked 3 times\)$") as caught:
        asking(monkeypatch, case, in_turn(PASSING[failure]))
    assert KEY not in str(caught.value)
    assert caught.value.tried_again


def test_a_provider_that_cannot_be_reached_is_given_up_after_the_stated_attempts(monkeypatch, case):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        monkeypatch.setenv("OPENAI_API_BASE", f"http://127.0.0.1:{unused.getsockname()[1]}/v1")
    chosen = llm_settings(llm_provider_attempts=4)
    client = llm_client(chosen)
    slept: list[float] = []
    client.sleep = slept.append
    with pytest.raises(TransientFailure, match=r"Connection error.*\(asked 4 times\)"):
        by_model(case, chosen, client)
    assert slept == [2.0, 4.0, 8.0]


@pytest.mark.parametrize(
    ("wait_s", "times"),
    # A pause of two thirds leaves room for another request, the next does not; a longer one is never waited for.
    [("10000", "asked 2 times"), ("20000", "asked once")],
)
def test_a_question_takes_no_longer_than_it_may(monkeypatch, case, wait_s, times):
    busy = failing(429, **{"Retry-After": wait_s})
    with pytest.raises(TransientFailure, match=times):
        asking(monkeypatch, case, in_turn(busy), llm_question_time_s=15_000.0, llm_provider_attempts=9)


def test_a_time_out_is_a_transient_failure(monkeypatch, case):
    slow = dataclasses.replace(completion(right_answer(case)), delay_s=5.0)
    with pytest.raises(TransientFailure, match=r"Timeout.*asked 2 times"):
        asking(monkeypatch, case, in_turn(slow), llm_timeout_s=0.2, llm_provider_attempts=2)


def test_an_answer_that_comes_byte_by_byte_does_not_outlive_the_time_limit(monkeypatch, case):
    dripping = dataclasses.replace(completion(right_answer(case)), byte_s=0.1)
    began_s = time.monotonic()
    with pytest.raises(TransientFailure, match=r"no complete answer within 0.5 s.*asked 2 times"):
        asking(monkeypatch, case, in_turn(dripping), llm_timeout_s=0.5, llm_provider_attempts=2)
    assert time.monotonic() - began_s < 60  # its bytes take minutes


@pytest.mark.parametrize("wait_s", ["nan", "inf", "-inf", "-3"])
def test_a_pause_that_is_none_is_not_waited_out(monkeypatch, case, wait_s):
    respond = in_turn(failing(429, **{"Retry-After": wait_s}), completion(right_answer(case)))
    asked = asking(monkeypatch, case, respond)
    assert asked.slept in ([2.0], [0.0])


def test_a_negative_usage_gives_no_money_back(monkeypatch, case):
    whole = completion(right_answer(case))
    body = json.loads(whole.body)
    body["usage"] = {"prompt_tokens": -(10**9), "completion_tokens": -(10**9), "total_tokens": -2 * 10**9}
    asked = asking(monkeypatch, case, in_turn(dataclasses.replace(whole, body=json.dumps(body).encode())))
    assert asked.estimate.run.cost_usd == 0.0
    assert asked.estimate.run.prompt_tokens == 0


def test_an_answer_is_not_taken_for_that_of_another_endpoint(monkeypatch):
    client = LlmClient("openai/gpt-4o")
    question = {"messages": [{"role": "user", "content": "Where?"}], "prompt": "v1", "schema": {"type": "object"}}
    for expected in ("here", "there"):
        with serving(in_turn(completion(expected))) as server:
            monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
            assert [client.ask(**question).text for _ in range(2)] == [expected] * 2
            assert len(server.requests) == 1


@pytest.mark.parametrize("status", [400, 401, 402, 403, 404])
def test_unanswerable_requests_fail_and_show_no_key(monkeypatch, case, caplog, status):
    caplog.set_level(logging.DEBUG)
    with pytest.raises(Failure, match=r"llm_model") as caught:
        asking(monkeypatch, case, in_turn(failing(status)))
    assert not isinstance(caught.value, TransientFailure)
    assert KEY not in str(caught.value)


@pytest.mark.parametrize(
    ("model", "key"),
    [
        ("gemini/gemini-3-flash-preview", "GEMINI_API_KEY"),
        ("openai/gpt-4o", "OPENAI_API_KEY"),
        ("anthropic/claude-sonnet-4-5", "ANTHROPIC_API_KEY"),
    ],
)
def test_a_missing_key_is_named_and_not_waited_for(monkeypatch, case, model, key):
    for name in ("GEMINI_API_KEY", "GOOGLE_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY", "OPENAI_API_BASE"):
        monkeypatch.delenv(name, raising=False)
    chosen = llm_settings(llm_model=model)
    with pytest.raises(Failure, match=f"the environment lacks .*{key}") as caught:
        by_model(case, chosen, llm_client(chosen))
    assert not isinstance(caught.value, TransientFailure)


def test_a_trial_asks_one_short_question_a_minute_and_counts_for_the_budget(monkeypatch):
    chosen = llm_settings(llm_budget_usd=COST_USD)
    with serving(in_turn(completion("?"))) as server:
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        client = llm_client(chosen)
        client.try_out()
        client.try_out()
        assert len(server.requests) == 1
        now = time.monotonic()
        monkeypatch.setattr("trace_dag.language.client.time.monotonic", lambda: now + 61.0)
        with pytest.raises(Failure, match=r"the budget of .* is spent"):
            client.try_out()


def test_a_refused_key_is_not_asked_with_again(monkeypatch):
    with serving(in_turn(failing(401))) as server:
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        with pytest.raises(Failure, match="AuthenticationError") as caught:
            llm_client(llm_settings()).try_out()
        assert len(server.requests) == 1
        assert KEY not in str(caught.value)


def test_a_model_nobody_serves_is_a_failure(monkeypatch, case):
    with pytest.raises(Failure, match=r"nobody/nothing: .*check states\.llm_model"):
        asking(monkeypatch, case, in_turn(completion("")), llm_model="nobody/nothing")


def test_repeated_questions_cost_nothing(monkeypatch, case, tmp_path):
    good = right_answer(case)
    files = Storage(tmp_path)
    respond = in_turn(completion("nonsense"), completion(good))
    monkeypatch.setattr("trace_dag.language.client.endpoint_of", lambda model: "one address for all servers")
    first = asking(monkeypatch, case, respond, files=files)
    again = asking(monkeypatch, case, in_turn(failing(500)), files=files)
    assert len(first.server.requests) == 2
    assert again.server.requests == []
    assert estimate_to_json(again.estimate) == estimate_to_json(first.estimate)
    for change in ({"llm_model": "openai/gpt-4.1"}, {"llm_max_output_tokens": 4000}):
        other = asking(monkeypatch, case, in_turn(completion(good)), files=files, **change)
        assert len(other.server.requests) == 1, change
    assert json.loads(other.server.requests[0].body)["max_tokens"] == 4000


def test_a_failure_is_never_stored(monkeypatch, case, tmp_path):
    with pytest.raises(TransientFailure):
        asking(monkeypatch, case, in_turn(failing(500)), files=Storage(tmp_path))
    assert not list(tmp_path.glob("llm_answers/**/*.json"))


def test_no_key_in_logs_artefacts_or_stored_answers(monkeypatch, case, tmp_path, caplog, capfd):
    caplog.set_level(logging.DEBUG)
    files = Storage(tmp_path)
    respond = in_turn(failing(429), completion(f"nonsense after {KEY}"), completion(right_answer(case)))
    asked = asking(monkeypatch, case, respond, files=files)
    written = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
    own_log = "\n".join(record.getMessage() for record in caplog.records)
    out, err = capfd.readouterr()
    assert len(written) > 100
    for text in (written.decode(), estimate_to_json(asked.estimate).decode(), own_log, out, err):
        assert KEY not in text


def test_a_budget_for_a_model_without_a_price_is_reported_not_to_hold(monkeypatch, case, caplog):
    answer = completion(right_answer(case))
    unpriced = dataclasses.replace(answer, body=answer.body.replace(b"gpt-4o", b"our-own-model"))
    asked = asking(monkeypatch, case, in_turn(unpriced), llm_model="openai/our-own-model", llm_budget_usd=1.0)
    assert asked.estimate.run.cost_usd == 0
    assert "no price" in caplog.text
