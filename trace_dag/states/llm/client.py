"""Asking a model through litellm: any provider, one question at a time.

Keys and endpoints are read by litellm from the provider's usual environment variables (``GEMINI_API_KEY``,
``OPENAI_API_KEY``, ``OPENAI_API_BASE``, ``OLLAMA_API_BASE``, ...); no key passes through this project, and whatever a
provider says back is cleared of them before it is shown. Temperature stays the provider's default; determinism comes
from stored answers.
"""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from trace_dag.errors import Failure, TransientFailure
from trace_dag.states.llm.ledger import Ledger
from trace_dag.states.llm.prompt import Message
from trace_dag.states.llm.store import AnswerStore, StoredAnswer, question_key

PROVIDER_ATTEMPTS = 3
LONGEST_WAIT_S = 60.0
_FIRST_WAIT_S = 2.0
_SECRET_NAME = re.compile(r"(KEY|TOKEN|SECRET|PASSWORD|CREDENTIAL)", re.IGNORECASE)
_KEY_SHAPED = re.compile(r"\b(sk|pk|AIza|gsk|xai|hf)[-_A-Za-z0-9]{12,}")
_SHORTEST_SECRET = 6
REFUSED = "refused"

log = logging.getLogger(__name__)


@dataclass
class LlmClient:
    """One model with its store of answers and its ledger. ``sleep`` (seconds) can be replaced in tests."""

    model: str
    timeout_s: float
    store: AnswerStore = field(default_factory=AnswerStore)
    ledger: Ledger = field(default_factory=Ledger)
    sleep: Callable[[float], None] = time.sleep

    def ask(self, messages: list[Message], *, prompt: str, schema: Mapping[str, Any]) -> StoredAnswer:
        """The answer to a question, from the store if it was asked before. ``prompt``: version and digest.

        A refusal comes back as an answer with the finish reason :data:`REFUSED`.

        Raises:
            TransientFailure: the provider did not answer (429, 5xx, time-out) after several tries.
            Failure: it never will (no such model, no key, malformed request), or the budget is spent.
        """
        key = question_key(model=self.model, prompt=prompt, messages=messages, schema=schema)
        stored = self.store.get(key)
        if stored is None:
            stored = self._ask(messages, schema)
            self.store.put(key, stored)
        return stored

    def _ask(self, messages: list[Message], schema: Mapping[str, Any]) -> StoredAnswer:
        litellm = _litellm()
        errors = litellm.exceptions
        passing = (
            errors.RateLimitError,
            errors.Timeout,
            errors.APIConnectionError,
            errors.InternalServerError,
            errors.ServiceUnavailableError,
            errors.BadGatewayError,
        )
        for attempt in range(1, PROVIDER_ATTEMPTS + 1):
            self.ledger.reserve()
            started = time.monotonic()
            try:
                response = litellm.completion(
                    model=self.model,
                    messages=messages,
                    timeout=self.timeout_s,
                    num_retries=0,
                    max_retries=0,
                    drop_params=True,
                    response_format={
                        "type": "json_schema",
                        "json_schema": {"name": "answer", "schema": dict(schema)},
                    },
                )
            except errors.ContentPolicyViolationError as error:
                return StoredAnswer(without_secrets(str(error))[:500], REFUSED, self.model, 0, 0, 0.0, 0.0)
            except passing as error:
                what = f"{self.model}: {type(error).__name__}: {without_secrets(str(error))[:300]}"
                wait_s = _retry_after_s(error)
                if wait_s is None:
                    wait_s = _FIRST_WAIT_S * 2 ** (attempt - 1)
                if attempt == PROVIDER_ATTEMPTS or wait_s > LONGEST_WAIT_S:
                    raise TransientFailure(f"{what} (asked {attempt} times)") from None
                log.warning("%s; asking again in %.0f s", what, wait_s)
                self.sleep(wait_s)
            except _every_error() as error:
                text = without_secrets(str(error))[:300]
                raise Failure(
                    f"{self.model}: {type(error).__name__}: {text}; "
                    "check states.llm_model and the provider's environment variables"
                ) from None
            else:
                answer = _stored(litellm, response, self.model, time.monotonic() - started)
                self.ledger.charge(answer.cost_usd)
                return answer
        raise AssertionError("the loop returns or raises")


def _stored(litellm: Any, response: Any, model: str, latency_s: float) -> StoredAnswer:
    choice = response.choices[0] if response.choices else None
    text = (choice.message.content or "") if choice is not None else ""
    finish = str(choice.finish_reason or "") if choice is not None else "nothing"
    extra = getattr(choice.message, "provider_specific_fields", None) if choice is not None else None
    refusal = (extra or {}).get("refusal")  # where litellm puts OpenAI's field
    if refusal or finish == "content_filter":
        text, finish = str(refusal or text), REFUSED
    usage = getattr(response, "usage", None)
    try:
        cost = float(litellm.completion_cost(completion_response=response))
    except Exception:
        cost = 0.0
    return StoredAnswer(
        text=text,
        finish_reason=finish,
        model=str(getattr(response, "model", None) or model),
        prompt_tokens=int(getattr(usage, "prompt_tokens", 0) or 0),
        completion_tokens=int(getattr(usage, "completion_tokens", 0) or 0),
        cost_usd=round(cost, 8),
        latency_s=round(latency_s, 3),
    )


def _retry_after_s(error: Exception) -> float | None:
    response = getattr(error, "response", None)
    headers = getattr(response, "headers", None) or getattr(error, "litellm_response_headers", None) or {}
    value = headers.get("retry-after")
    try:
        return max(float(value), 0.0) if value is not None else None
    except ValueError:
        return None  # a date: wait as long as without


def without_secrets(text: str) -> str:
    """The text with the values of secret environment variables, and anything shaped like a key, blotted out."""
    for name, value in os.environ.items():
        if _SECRET_NAME.search(name) and len(value) >= _SHORTEST_SECRET:
            text = text.replace(value, "***")
    return _KEY_SHAPED.sub("***", text)


def _every_error() -> type[Exception]:
    import openai  # litellm's exceptions are subclasses of this package's

    return openai.OpenAIError


def _litellm() -> Any:
    # Otherwise the import fetches a price list over the network.
    os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
    try:
        import litellm
    except ImportError as error:
        raise Failure("the llm estimator needs the package litellm; install it, or set states.estimator") from error
    litellm.suppress_debug_info = True
    litellm.telemetry = False
    logging.getLogger("LiteLLM").setLevel(logging.ERROR)  # its messages quote requests
    return litellm
