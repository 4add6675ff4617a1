"""Answers of models, stored by the content of the question: a question asked again costs nothing.

Answers are stored, right or wrong; a provider's failures are not.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import DamagedFile
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage

FOLDER = "llm_answers"
REFUSED = "refused"
TOO_LONG = "too long"
"""Finish reasons of ours: the model refused, and its context does not hold the question."""


@dataclass(frozen=True)
class StoredAnswer:
    """One answer and what it cost: latency in seconds, cost in US dollars (0 if the price is unknown)."""

    text: str
    finish_reason: str
    model: str  # the model's name as the provider gives it
    prompt_tokens: int
    completion_tokens: int
    cost_usd: float
    latency_s: float


_answers = TypeAdapter(StoredAnswer)


class AnswerStore:
    """Answers below one storage root; if none is given, in memory for this process alone."""

    def __init__(self, files: Storage | None = None) -> None:
        self._files = files
        self._memory: dict[str, StoredAnswer] = {}

    def get(self, key: str) -> StoredAnswer | None:
        """Return the answer stored under ``key``; None if it is missing or unreadable."""
        if self._files is None:
            return self._memory.get(key)
        try:
            return _answers.validate_python(check_document(self._files.read(_name(key)), name=_name(key)))
        except (FileNotFoundError, DamagedFile, ValidationError):
            return None

    def put(self, key: str, answer: StoredAnswer) -> None:
        """Store an answer."""
        if self._files is None:
            self._memory[key] = answer
        else:
            self._files.write(_name(key), add_checksum(_answers.dump_json(answer)))


def question_key(**question: object) -> str:
    """Return the key of a question: a digest of all its named parts."""
    return hashlib.sha256(json.dumps(question, sort_keys=True).encode()).hexdigest()


def _name(key: str) -> str:
    return f"{FOLDER}/{key[:2]}/{key}.json"
