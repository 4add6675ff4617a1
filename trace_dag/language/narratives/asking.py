"""The two questions to a language model: the facts of a narrative, and whether the quoted words support them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from importlib import resources
from string import Template
from typing import Any, Final, Protocol, TypeVar

from trace_dag.language.answer import WrongAnswer, parse, text_of
from trace_dag.language.narratives.reading import (
    Answer,
    Fact,
    NarrativeEvent,
    Reading,
    Support,
    complaint_about,
    drop_contradictions,
)
from trace_dag.language.narratives.vocabulary import Field, Vocabulary
from trace_dag.language.prompt import Message, ask_again, fence
from trace_dag.language.store import StoredAnswer

T = TypeVar("T")
_LONGEST_NARRATIVE: Final = 100_000  # characters
_MOST_COMPLAINTS: Final = 10


class Model(Protocol):
    """A model that can be asked; :class:`trace_dag.language.client.LlmClient` is one."""

    def ask(self, messages: list[Message], *, prompt: str, schema: Mapping[str, Any]) -> StoredAnswer:
        """Return the answer to a question; ``prompt`` is its version."""
        ...


def read_narrative(narrative: str, known: Vocabulary, model: Model, *, attempts: int) -> Reading:
    """Read the facts of a narrative that its words support.

    A wrong answer is asked again with its faults, up to ``attempts`` answers; the valid parts of the last one are used.
    Raises :class:`WrongAnswer` if no answer can be read, and the model's errors.
    """
    said, not_taken = _said(narrative, known, model, attempts)
    if not said:
        return Reading(not_taken=tuple(not_taken))
    supported = _supported(narrative, said, model, attempts)
    not_taken += [
        f"{each.claim}: the words {each.words!r} do not say so"
        for number, each in enumerate(said, 1)
        if number not in supported
    ]
    kept = [each for number, each in enumerate(said, 1) if number in supported]
    facts = tuple(each for each in kept if isinstance(each, Fact))
    events = tuple(each for each in kept if isinstance(each, NarrativeEvent))
    return drop_contradictions(Reading(facts, events, (), tuple(not_taken)))


def _said(
    narrative: str, known: Vocabulary, model: Model, attempts: int
) -> tuple[list[Fact | NarrativeEvent], list[str]]:
    """Return a model's reading, and sentences on the invalid parts of its last answer."""
    last: tuple[list[Fact | NarrativeEvent], list[str]] = ([], [])

    def taken(text: str) -> tuple[list[Fact | NarrativeEvent], list[str]]:
        nonlocal last
        answer = parse(text, Answer)
        everything: list[Fact | NarrativeEvent] = [*answer.facts, *answer.events]
        wrong = [complaint_about(each, narrative, known) for each in everything]
        complaints = [each for each in wrong if each is not None]
        last = ([each for each, complaint in zip(everything, wrong, strict=True) if complaint is None], complaints)
        if complaints:
            raise WrongAnswer(complaints[:_MOST_COMPLAINTS])
        return last

    values = {"fields": _in_words(known), "narrative": fence(narrative, longest=_LONGEST_NARRATIVE)}
    try:
        return _asked(model, "reading", values, known.schema, taken, attempts)
    except WrongAnswer:
        if not any(last):
            raise
        return last


def _supported(narrative: str, said: list[Fact | NarrativeEvent], model: Model, attempts: int) -> set[int]:
    """Return the numbers of the statements that their quotations support, by the model's second answer."""
    statements = [{"number": n, "statement": each.claim, "words": each.words} for n, each in enumerate(said, 1)]
    values = {
        "statements": fence(statements, longest=_LONGEST_NARRATIVE),
        "narrative": fence(narrative, longest=_LONGEST_NARRATIVE),
    }

    def numbers(text: str) -> set[int]:
        return set(parse(text, Support).supported)

    return _asked(model, "support", values, Support.model_json_schema(), numbers, attempts)


def _asked(
    model: Model,
    question: str,
    values: Mapping[str, str],
    schema: Mapping[str, Any],
    taken: Callable[[str], T],
    attempts: int,
) -> T:
    """Ask until ``taken`` accepts an answer, and return its result.

    Raises :class:`WrongAnswer` for the last answer.
    """
    text = resources.files("trace_dag.language.narratives").joinpath(f"{question}.md").read_text(encoding="utf-8")
    system, user = text.removeprefix("# system\n").split("\n# user\n")
    messages = [
        {"role": "system", "content": Template(system).substitute(values).strip()},
        {"role": "user", "content": Template(user).substitute(values).strip()},
    ]
    version = f"narrative-{question}:{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    for left in reversed(range(attempts)):
        answer = model.ask(messages, prompt=version, schema=schema)
        try:
            return taken(text_of(answer))
        except WrongAnswer as wrong:
            if not left:
                raise
            messages = ask_again(messages, answer.text, wrong.complaints)
    raise ValueError(f"{attempts} attempts; expected at least one")


def _in_words(known: Vocabulary) -> str:
    """Return the vocabulary as lines of a prompt."""

    def lines(fields: Mapping[str, Field]) -> str:
        return "\n".join(f"- {json.dumps(field.label)}: {_values(field)}" for field in fields.values())

    return (
        f"Fields of the crash (unit 0):\n{lines(known.of_crash)}\n\nFields of a unit:\n{lines(known.of_unit)}\n\n"
        f"Events: {', '.join(map(json.dumps, known.events))}\n\n"
        f"Areas of a vehicle: {', '.join(map(json.dumps, known.areas))}"
    )


def _values(field: Field) -> str:
    if field.values:
        return ", ".join(map(json.dumps, field.values))
    if field.units:
        return f"a number with its unit, one of {', '.join(field.units)}"
    return "a number" if field.counts else "a text"
