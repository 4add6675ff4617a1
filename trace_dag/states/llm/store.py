"""Answers of models, kept by the content of the question: what was asked once costs nothing again.

Only answers are kept, right or wrong; a provider's failure never is.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Protocol

from pydantic import TypeAdapter, ValidationError

from trace_dag.errors import DamagedFile
from trace_dag.sealing import sealed, unsealed

FOLDER = "llm_answers"


class Files(Protocol):
    """Named files; :class:`trace_dag.storage.Storage` is one."""

    def read(self, name: str) -> bytes:
        """The whole file; ``FileNotFoundError`` where there is none."""

    def write(self, name: str, data: bytes) -> object:
        """Put it there in one step."""


@dataclass(frozen=True)
class StoredAnswer:
    """One answer and what it took. Latency in seconds, cost in US dollars (0 where the price is unknown)."""

    text: str
    finish_reason: str
    model: str  # as the provider names what answered
    prompt_tokens: int
    completion_tokens: int
    cost_usd: float
    latency_s: float


_answers = TypeAdapter(StoredAnswer)


class AnswerStore:
    """Answers below one storage root, or in memory for this process alone where none is given."""

    def __init__(self, files: Files | None = None) -> None:
        self._files = files
        self._memory: dict[str, StoredAnswer] = {}

    def get(self, key: str) -> StoredAnswer | None:
        """The answer stored under ``key``; None if there is none, or if what is there cannot be read."""
        if self._files is None:
            return self._memory.get(key)
        try:
            return _answers.validate_json(unsealed(self._files.read(_name(key)), name=_name(key)))
        except (FileNotFoundError, DamagedFile, ValidationError):
            return None

    def put(self, key: str, answer: StoredAnswer) -> None:
        """Keep an answer."""
        if self._files is None:
            self._memory[key] = answer
        else:
            self._files.write(_name(key), sealed(_answers.dump_json(answer, indent=1)))


def question_key(**question: object) -> str:
    """The key of a question: a digest of everything that makes it what it is."""
    return hashlib.sha256(json.dumps(question, sort_keys=True).encode()).hexdigest()


def _name(key: str) -> str:
    return f"{FOLDER}/{key[:2]}/{key}.json"
