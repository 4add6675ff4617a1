"""The estimator that asks a language model.

It checks the answer, asks again with a list of faults, and has the solver turn the choice into states.
"""

from __future__ import annotations

from dataclasses import asdict, replace

from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.language.answer import Decision, WrongAnswer, decide, form, parse, schema_of, text_of
from trace_dag.language.choices import Choices
from trace_dag.language.client import LlmClient
from trace_dag.language.ledger import SpendingLedger
from trace_dag.language.prompt import Prompt, ask_again
from trace_dag.language.store import AnswerStore, StoredAnswer
from trace_dag.reconstruction.analytic_hypotheses import NAME as ANALYTIC
from trace_dag.reconstruction.analytic_hypotheses import VERSION as ANALYTIC_VERSION
from trace_dag.reconstruction.analytic_hypotheses import first_contact, parties, rank_hypotheses, solve_all
from trace_dag.reconstruction.candidates import candidates
from trace_dag.reconstruction.estimate import UnusableAnswers
from trace_dag.reconstruction.pre_crash_scenarios import pre_crash_scenarios
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.simulation.states import EstimatorRun, Hypothesis, StateEstimate

NAME = "llm"
VERSION = "1"
_MOST_CHECKS = 4


def llm_client(settings: StateSettings, *, files: Storage | None = None, ledger: str = "run") -> LlmClient:
    """Return a client by the settings, with answers, budget and rate in ``files`` (a storage root) or in memory.

    Clients with the same ``files`` and ``ledger`` share budget and rate, over all processes and machines.

    >>> llm_client(StateSettings(llm_model="a-model")).model
    'a-model'
    """
    return LlmClient(
        model=settings.llm_model,
        timeout_s=settings.llm_timeout_s,
        attempts=settings.llm_provider_attempts,
        question_time_s=settings.llm_question_time_s,
        max_output_tokens=settings.llm_max_output_tokens,
        store=AnswerStore(files),
        ledger=SpendingLedger(
            settings.llm_budget_usd, settings.llm_requests_per_minute, files, settings.llm_ledger or ledger
        ),
    )


Given = list[tuple[StoredAnswer, list[str]]]
"""The answers so far, each with its faults."""


def _run(settings: StateSettings, given: Given) -> EstimatorRun:
    answers = [answer for answer, _ in given]
    return EstimatorRun(
        estimator=NAME,
        version=VERSION,
        model=settings.llm_model,
        prompt_version=settings.llm_prompt,
        attempts=len(answers),
        prompt_tokens=sum(each.prompt_tokens for each in answers),
        completion_tokens=sum(each.completion_tokens for each in answers),
        cost_usd=round(sum(each.cost_usd for each in answers), 8),
        latency_s=round(_latency_s(given), 3),
        answers=tuple({**asdict(answer), "complaints": complaints} for answer, complaints in given),
    )


def _latency_s(given: Given) -> float:
    return sum((answer.latency_s for answer, _ in given), 0.0)


def estimate_llm(scene: Scene, event: CrashEvent, settings: StateSettings, client: LlmClient) -> StateEstimate:
    """Return the contact of two vehicles on the approaches that a language model chose.

    A wrong answer counts as an attempt; after ``llm_max_attempts`` of them, or after ``llm_question_time_s``, the
    fallback of the settings follows.

    Raises: Rejection: ``no_feasible_state``: no approach lets the vehicles meet, or no answer was usable and the
    fallback is "reject" (:class:`UnusableAnswers`). TransientFailure, Failure: the provider failed or the budget is
    spent, see :meth:`LlmClient.ask`. UserError: no such prompt.

    >>> from trace_dag.reconstruction.analytic_hypotheses import build_scene
    >>> class Unhelpful:  # in place of a client that asks a provider
    ...     def ask(self, messages, *, prompt, schema):
    ...         return StoredAnswer("I do not know.", "stop", "a-model", 900, 5, 0.0, 1.0)
    >>> scene = build_scene(record, network, map_report, lead_time_s=5.0)
    >>> event = sequence.first
    >>> made = estimate_llm(scene, event, StateSettings(llm_model="a-model"), Unhelpful())
    >>> made.run.estimator, made.run.fallback_from, made.run.attempts
    ('analytic', 'llm', 3)
    """
    prompt = Prompt.load(settings.llm_prompt)
    record = scene.record
    one, two = parties(record, event)
    numbers = (one.vehicle.number, two.vehicle.number)
    found = [each for reading in pre_crash_scenarios(record, one, two) for each in candidates(scene, reading)]
    choices = Choices(scene, tuple(found))
    if not choices.offered:
        first_contact(scene, event, settings)  # this raises the rejection that says why
    schema = schema_of(prompt.kind, choices)
    messages = prompt.messages(record, choices, lead_time_s=settings.lead_time_s)
    given: Given = []
    while len(given) < settings.llm_max_attempts and _latency_s(given) < settings.llm_question_time_s:
        answer = client.ask(messages, prompt=f"{prompt.version}:{prompt.file.digest}", schema=schema)
        try:
            said = parse(text_of(answer), form(prompt.kind))
            decision = decide(said, choices, record, numbers, lead_time_s=settings.lead_time_s)
            hypotheses, ambiguity = _solved(choices, decision, settings)
        except WrongAnswer as wrong:
            given.append((answer, wrong.complaints))
            messages = ask_again(messages, answer.text, wrong.complaints)
            continue
        given.append((answer, []))
        return StateEstimate(record.key, hypotheses, _run(settings, given), ambiguity)
    last = "; ".join(given[-1][1]) if given else ""
    tries = count_of(len(given), "attempt")
    slow = f", {_latency_s(given):.0f} s" if len(given) < settings.llm_max_attempts else ""
    why = f"{settings.llm_model} gave no usable answer in {tries}{slow}; the last: {last}"
    asked = _run(settings, given)
    if settings.llm_fallback == "reject":
        raise UnusableAnswers(why, asked, threshold=settings.llm_max_attempts)
    hypotheses, ambiguity = first_contact(scene, event, settings)
    run = replace(
        asked, estimator=ANALYTIC, version=ANALYTIC_VERSION, fallback_from=asked.estimator, fallback_reason=why
    )
    return StateEstimate(record.key, hypotheses, run, ambiguity)


def _solved(choices: Choices, decision: Decision, settings: StateSettings) -> tuple[tuple[Hypothesis, ...], float]:
    """Return hypotheses on the chosen approaches.

    Raises :class:`WrongAnswer` if they fail their checks, so that the model is asked again.
    """
    chosen = choices.chosen(decision.offered)
    ids = " and ".join(f"{offered.id} for vehicle {number}" for number, offered in decision.offered.items())
    if not chosen:
        raise WrongAnswer(
            [f"No manoeuvre the report allows leads to the crash on {ids} together: no path to the crash exists."]
        )
    hypotheses, ambiguity = rank_hypotheses(choices.scene, solve_all(choices.scene, chosen), settings)
    if not hypotheses:
        raise WrongAnswer([f"On {ids} the vehicles do not touch near the reported place."])
    failed = [check for check in hypotheses[0].checks if not check.passed]
    if failed:
        failed = [check for check in failed if check.name not in _unavoidable(choices, settings)]
    if failed:
        raise WrongAnswer([f"With {ids}: {check.name}: {check.detail}." for check in failed[:_MOST_CHECKS]])
    return hypotheses, ambiguity


def _unavoidable(choices: Choices, settings: StateSettings) -> set[str]:
    """Return checks that fail for every choice of approaches.

    The record then contradicts itself or the map, and another answer would not help.
    """
    best, _ = rank_hypotheses(choices.scene, solve_all(choices.scene, list(choices.found)), settings)
    return {check.name for check in best[0].checks if not check.passed} if best else set()
