"""Requests to a model through litellm: any provider, one question at a time.

Keys and endpoints are read by litellm from the provider's usual environment variables (``GEMINI_API_KEY``,
``OPENAI_API_KEY``, ``OPENAI_API_BASE``, ``OLLAMA_API_BASE``, ...); no key passes through this project, and keys are
removed from a provider's messages before they are shown. The temperature is the provider's default; results can be
repeated because answers are stored.
"""

from __future__ import annotations

import logging
import math
import os
import re
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass, field
from functools import partial
from pathlib import PureWindowsPath
from typing import Any, TypeVar
from urllib.parse import urlsplit

from tenacity import RetryCallState, Retrying, retry_if_exception_type, wait_exponential

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.language.ledger import SpendingLedger
from trace_dag.language.prompt import Message
from trace_dag.language.store import REFUSED, TOO_LONG, AnswerStore, StoredAnswer, question_key

_BACK_OFF = wait_exponential(multiplier=2.0)  # seconds: 2, 4, 8, ...
_PASSING_STATUS = frozenset({408, 425, 429})  # and every 5xx
_SECRET_NAME = re.compile(r"(KEY|TOKEN|SECRET|PASSWORD|CREDENTIAL)", re.IGNORECASE)
_KEY_SHAPED = re.compile(r"\b(sk|pk|AIza|gsk|xai|hf)[-_A-Za-z0-9]{12,}")
_SHORTEST_SECRET = 6
_LONGEST_MESSAGE = 300
_LONGEST_ANSWER = 200_000  # characters: a hundred times what the schema of an answer needs
KEY_MISSING = "the environment lacks"
_KEY_WANTED = re.compile(r"api.?key|credential", re.IGNORECASE)
_REFUSED_STATUS = (401, 403)
_ANSWERING_FOR_S = 60.0  # for so long after an answer the provider is not tried out again
_TRIAL: list[Message] = [{"role": "user", "content": 'Are you there? Answer with {"ready": true}.'}]
_TRIAL_ANSWER = {
    "type": "object",
    "properties": {"ready": {"type": "boolean"}},
    "required": ["ready"],
    "additionalProperties": False,
}
_ITS_TRACEBACK = "Traceback (most recent call last)"  # litellm quotes one in some of its messages

log = logging.getLogger(__name__)
T = TypeVar("T")


@dataclass
class LlmClient:
    """One model with its store of answers and its ledger.

    A request may take ``timeout_s``; an answer takes at most ``attempts`` requests and, with the pauses between them,
    ``question_time_s``. ``max_output_tokens`` counts a model's thinking too. ``sleep`` (seconds) is for tests.
    """

    model: str
    timeout_s: float = 120.0
    attempts: int = 3
    question_time_s: float = 140.0
    max_output_tokens: int | None = None
    store: AnswerStore = field(default_factory=AnswerStore)
    ledger: SpendingLedger = field(default_factory=SpendingLedger)
    sleep: Callable[[float], None] = time.sleep
    _warned_of_price: bool = field(default=False, init=False, repr=False)
    _answered_s: float = field(default=-math.inf, init=False, repr=False)  # by the monotonic clock

    def try_out(self) -> None:
        """Check that the model answers: one short question, unless it has answered within the last minute.

        The content of the answer does not matter. The question shows whether key, model, budget and connection are
        right. Raises the errors of :meth:`ask`.
        """
        if time.monotonic() - self._answered_s > _ANSWERING_FOR_S:
            self._ask(_TRIAL, _TRIAL_ANSWER)

    def ask(self, messages: list[Message], *, prompt: str, schema: Mapping[str, Any]) -> StoredAnswer:
        """Return the answer to a question, from the store if it was asked before.

        ``prompt``: version and digest.

        A refusal comes back as an answer with the finish reason :data:`REFUSED`, a question that the model's context
        does not hold as one with :data:`TOO_LONG`.

        Raises:
            TransientFailure: the provider did not answer (429, 5xx, time-out, unreachable) after several tries.
            Failure: asking again would not help (no such model, no key, malformed request), or the budget is spent.
        """
        limits = {} if self.max_output_tokens is None else {"max_output_tokens": self.max_output_tokens}
        asked_at = endpoint_of(self.model)
        key = question_key(
            model=self.model, endpoint=asked_at, prompt=prompt, messages=messages, schema=schema, **limits
        )
        stored = self.store.get(key)
        if stored is None:
            stored = self._ask(messages, schema)
            self.store.put(key, stored)
        return stored

    def _ask(self, messages: list[Message], schema: Mapping[str, Any]) -> StoredAnswer:
        taken_s = 0.0  # time of requests: waiting for one's turn does not count

        def ask_once() -> StoredAnswer:
            nonlocal taken_s
            left_s = self.question_time_s - taken_s - trying.statistics["idle_for"]
            self.ledger.reserve()
            started = time.monotonic()
            try:
                return self._request(messages, schema, min(self.timeout_s, left_s))
            finally:
                taken_s += time.monotonic() - started

        def enough(state: RetryCallState) -> bool:
            then_s = taken_s + state.idle_for + state.upcoming_sleep
            return state.attempt_number >= self.attempts or then_s >= self.question_time_s

        trying = Retrying(
            retry=retry_if_exception_type(_NoAnswer),
            stop=enough,
            wait=_pause_s,
            before_sleep=_say_asking_again,
            sleep=self.sleep,
            reraise=True,
        )
        try:
            answer = trying(ask_once)
        except _NoAnswer as none:
            self.ledger.unanswered()
            asked = trying.statistics["attempt_number"]
            times = "once" if asked == 1 else f"{asked} times"
            raise TransientFailure(f"{none} (asked {times})", tried_again=True) from None
        self.ledger.charge(answer.cost_usd)
        self._answered_s = time.monotonic()
        return answer

    def _request(self, messages: list[Message], schema: Mapping[str, Any], timeout_s: float) -> StoredAnswer:
        """Return the answer to one request.

        Raises :class:`_NoAnswer` if a repeated request may be answered, :class:`Failure` if none will.
        """
        litellm = _litellm()
        started = time.monotonic()
        limits = {} if self.max_output_tokens is None else {"max_tokens": self.max_output_tokens}
        try:
            response = _within(
                timeout_s,
                partial(
                    litellm.completion,
                    model=self.model,
                    messages=messages,
                    timeout=timeout_s,
                    num_retries=0,
                    max_retries=0,
                    drop_params=True,
                    response_format={"type": "json_schema", "json_schema": {"name": "answer", "schema": dict(schema)}},
                    **limits,
                ),
            )
        except _TooSlowError:
            raise _NoAnswer(f"{self.model}: Timeout: no complete answer within {timeout_s:.1f} s", None) from None
        except litellm.exceptions.ContentPolicyViolationError as error:
            return StoredAnswer(mask_secrets(str(error))[:500], REFUSED, self.model, 0, 0, 0.0, 0.0)
        except litellm.exceptions.ContextWindowExceededError as error:  # with the answers so far it became too long
            return StoredAnswer(mask_secrets(str(error))[:500], TOO_LONG, self.model, 0, 0, 0.0, 0.0)
        except Exception as error:  # errors of litellm, of its HTTP clients, and others that it lets through
            said = mask_secrets(str(error)).partition(_ITS_TRACEBACK)[0]
            what = f"{self.model}: {type(error).__name__}: {' '.join(said.split())[:_LONGEST_MESSAGE]}"
            wanted = _KEY_WANTED.search(said) or getattr(error, "status_code", None) in _REFUSED_STATUS
            if wanted and (missing := _missing_keys(litellm, self.model)):
                # Without a key some of litellm's providers look as if they could not be reached.
                lacking = " or ".join(missing)
                raise Failure(f"{self.model}: {KEY_MISSING} {lacking}, the key of its provider") from None
            if _may_pass(litellm, error):
                raise _NoAnswer(what, _retry_after_s(error)) from None
            raise Failure(f"{what}; check states.llm_model and the provider's environment variables") from None
        return self._stored(litellm, response, time.monotonic() - started)

    def _stored(self, litellm: Any, response: Any, latency_s: float) -> StoredAnswer:
        choice = response.choices[0] if response.choices else None
        text = (choice.message.content or "") if choice is not None else ""
        finish = str(choice.finish_reason or "") if choice is not None else "nothing"
        extra = getattr(choice.message, "provider_specific_fields", None) if choice is not None else None
        refusal = (extra or {}).get("refusal")  # where litellm puts OpenAI's field
        if refusal or finish == "content_filter":
            text, finish = str(refusal or text), REFUSED
        elif len(text) > _LONGEST_ANSWER:
            text, finish = text[:_LONGEST_ANSWER], "length"
        usage = getattr(response, "usage", None)
        return StoredAnswer(
            text=mask_secrets(text),  # a model may repeat what it was sent, headers included
            finish_reason=finish,
            model=_model_name(str(getattr(response, "model", None) or self.model)),
            prompt_tokens=max(int(getattr(usage, "prompt_tokens", 0) or 0), 0),
            completion_tokens=max(int(getattr(usage, "completion_tokens", 0) or 0), 0),
            cost_usd=round(self._cost_usd(litellm, response), 8),
            latency_s=round(latency_s, 3),
        )

    def _cost_usd(self, litellm: Any, response: Any) -> float:
        try:
            cost_usd = float(litellm.completion_cost(completion_response=response))
            return cost_usd if math.isfinite(cost_usd) and cost_usd > 0 else 0.0  # whatever usage a provider claims
        except Exception:  # litellm raises a bare Exception for a model without a price
            if self.ledger.budget_usd is not None and not self._warned_of_price:
                log.warning(
                    "%s: litellm knows no price of it; its answers count as 0 USD and no budget stops them", self.model
                )
                self._warned_of_price = True
            return 0.0


def _model_name(said: str) -> str:
    """Return the name of a model; llama.cpp's server gives a file path, of which only the name is shown."""
    path = PureWindowsPath(said)  # parts at both kinds of slashes
    return path.name if path.root else said


class _NoAnswer(Exception):  # noqa: N818 - becomes a failure if all tries end so
    """A request without an answer that may be repeated; ``wait_s`` is the pause that the provider asks for."""

    def __init__(self, message: str, wait_s: float | None) -> None:
        super().__init__(message)
        self.wait_s = wait_s


def _pause_s(state: RetryCallState) -> float:
    """Return the pause before a question is repeated, s.

    It is the pause that the provider asks for, or else doubles each time.
    """
    error = state.outcome.exception() if state.outcome else None
    asked_s = error.wait_s if isinstance(error, _NoAnswer) else None
    return asked_s if asked_s is not None else _BACK_OFF(state)


def _say_asking_again(state: RetryCallState) -> None:
    error = state.outcome.exception() if state.outcome else None
    log.warning("%s; asking again in %.0f s", error, state.upcoming_sleep)


def _missing_keys(litellm: Any, model: str) -> list[str]:
    """Return the missing environment variables with keys for the model's provider, as far as litellm knows them."""
    try:
        missing = litellm.validate_environment(model)["missing_keys"]
    except Exception:  # litellm raises for a model that it does not know
        return []
    return [name for name in missing if _SECRET_NAME.search(name)]


def _may_pass(litellm: Any, error: Exception) -> bool:
    if isinstance(error, litellm.exceptions.Timeout | litellm.exceptions.APIConnectionError):
        return True
    status = getattr(error, "status_code", None)
    return isinstance(status, int) and (status in _PASSING_STATUS or status >= 500)


def _retry_after_s(error: Exception) -> float | None:
    response = getattr(error, "response", None)
    headers = getattr(response, "headers", None) or getattr(error, "litellm_response_headers", None) or {}
    value = headers.get("retry-after")
    try:
        wait_s = float(value) if value is not None else math.nan
    except ValueError:
        return None  # a date: wait as if nothing were asked for
    return max(wait_s, 0.0) if math.isfinite(wait_s) else None


class _TooSlowError(Exception):
    pass


def _within(limit_s: float, call: Callable[[], T]) -> T:
    """Return the result of a call.

    Raises :class:`_TooSlowError` after ``limit_s``, also for a partial answer, since the time-outs of HTTP clients
    begin anew with every byte. The call continues in its thread, and its result is ignored.
    """
    answer: Future[T] = Future()

    def run() -> None:
        try:
            answer.set_result(call())
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=run, name="question", daemon=True).start()
    if not wait([answer], timeout=max(limit_s, 0.0)).done:
        raise _TooSlowError
    return answer.result()


def endpoint_of(model: str) -> str:
    """Return the endpoint of a model from the environment; "" means its provider's own address.

    >>> endpoint_of("a-provider/a-model")
    ''
    """
    provider = model.partition("/")[0].upper() if "/" in model else "OPENAI"
    names = (f"{provider}_API_BASE", f"{provider}_BASE_URL")
    address = urlsplit(next((value for name in names if (value := os.environ.get(name))), ""))
    return address._replace(netloc=address.netloc.rpartition("@")[2]).geturl().rstrip("/")


def mask_secrets(text: str) -> str:
    """Return the text with values of secret environment variables, and other text shaped like a key, as stars.

    >>> mask_secrets("invalid key sk-0123456789abcdefghijklmnop")
    'invalid key ***'
    """
    for name, value in os.environ.items():
        if _SECRET_NAME.search(name) and len(value) >= _SHORTEST_SECRET:
            text = text.replace(value, "***")
    return _KEY_SHAPED.sub("***", text)


def _litellm() -> Any:
    # Otherwise the import fetches a price list over the network.
    os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
    try:
        import litellm
    except ImportError as error:
        raise Failure(
            "a language model needs litellm: pip install 'trace-dag[llm]', or set states.estimator to analytic"
        ) from error
    litellm.suppress_debug_info = True
    litellm.telemetry = False
    logging.getLogger("LiteLLM").setLevel(logging.ERROR)  # its log messages quote requests
    return litellm
