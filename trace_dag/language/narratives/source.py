"""Narratives as a source of reports: a folder of text files, or a column of a register's table.

A text file may begin with lines such as ``time: 2023-05-03 16:20``, ``latitude: 41.83`` and ``longitude: -101.54``; the
rest is the narrative. Without coordinates the crash is placed at the crossing of the two streets that it names. The
narrative itself is not stored: the record only has the words quoted for its fields. A language model is asked for the
facts of a narrative, and whether the quoted words support them.
"""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from trace_dag.common.errors import UserError
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.messages.wording import count_of
from trace_dag.crash.listing import CrashListing, list_record
from trace_dag.crash.parse import report_to_json
from trace_dag.crash.record import CrashRecord, Octant
from trace_dag.crash.registers.table import RegisterTable
from trace_dag.crash.reported_place import FromCrossing, Place, PlaceFinder, look_up
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
from trace_dag.language.narratives.record import Narrative, merge_records, record_of
from trace_dag.language.narratives.vocabulary import CRASH, Field, Vocabulary, parse_measure, vocabulary
from trace_dag.language.prompt import Message, PromptFile, ask_again, fence
from trace_dag.language.store import StoredAnswer

_SHOWN: Final = 12
_HEADER: Final = re.compile(r"(?P<name>time|latitude|longitude): *(?P<value>.*)", re.IGNORECASE)
T = TypeVar("T")
_LONGEST_NARRATIVE: Final = 100_000  # characters
_MOST_COMPLAINTS: Final = 10


class Reader:
    """Reads narratives by a language model of that name. ``attempts``: answers to one question.

    ``find``: looks up crossings of streets.
    """

    def __init__(
        self,
        model: Model,
        name: str,
        *,
        attempts: int,
        find: PlaceFinder | None = None,
        on_progress: OnProgress = silent,
    ) -> None:
        self.name, self.find = name, find
        self._model, self._attempts, self._on_progress = model, attempts, on_progress

    def readings(self, texts: Mapping[str, str]) -> tuple[dict[str, Reading], dict[str, str]]:
        """Return the reading of each narrative, and the reasons for those without an answer.

        Raises the model's errors. Answers are stored, so that a repeated reading resumes.
        """
        readings: dict[str, Reading] = {}
        unread: dict[str, str] = {}
        for done, (name, text) in enumerate(texts.items()):
            self._on_progress(done, len(texts))
            try:
                readings[name] = read_narrative(text, vocabulary(), self._model, attempts=self._attempts)
            except WrongAnswer as wrong:
                unread[name] = f"no usable answer: {wrong}"
        self._on_progress(len(texts), len(texts))
        return readings, unread


class _Source(ABC):
    """A source of reports (:class:`trace_dag.flow.cohorts.sources.ReportTables`)."""

    def records(self) -> list[CrashRecord]:
        """Return every crash, in the order of the files' names or of the table.

        The narratives are read on first use.

        Raises the model's errors.
        """
        return self._read[0]

    def listings(self) -> list[CrashListing]:
        """Return one line per crash."""
        return [list_record(record) for record in self.records()]

    def reports(self, keys: Collection[str]) -> Iterator[tuple[str, bytes]]:
        """Return the key and record, as JSON, of the crashes asked for."""
        return ((record.key, report_to_json(record)) for record in self.records() if record.key in keys)

    @cached_property
    def _read(self) -> tuple[list[CrashRecord], dict[str, str]]:
        """Return the crashes, and of the narratives without one why."""
        return self._read_all()

    @abstractmethod
    def _read_all(self) -> tuple[list[CrashRecord], dict[str, str]]:
        """Read all narratives of the source."""


class NarrativeFolder(_Source):
    """The crashes of a folder's text files."""

    def __init__(self, folder: Path, reader: Reader) -> None:
        self._folder, self._reader = folder, reader
        self._narratives = narratives_in(folder)

    def notes(self) -> list[str]:
        """Return notes on the narratives that became crashes, those left out and why, and unsupported facts."""
        records, left_out = self._read
        narratives = f"{count_of(len(self._narratives), 'narrative')} in {self._folder}"
        notes = [f"{narratives}: {len(records)} with a place and time"]
        return [*notes, *(f"left out: {name}: {why}" for name, why in left_out.items()), *_remarks(records)]

    def _read_all(self) -> tuple[list[CrashRecord], dict[str, str]]:
        readings, left_out = self._reader.readings({each.id: each.text for each in self._narratives})
        told = [each for each in self._narratives if each.id in readings]
        wanted = {each.id: _place_in_words(readings[each.id]) for each in told if each.place is None}
        places, placeless = look_up(wanted, self._reader.find)
        records = []
        for narrative in told:
            if narrative.id in placeless:
                left_out[narrative.id] = placeless[narrative.id]
                continue
            made = record_of(narrative, places.get(narrative.id), readings[narrative.id], vocabulary())
            if isinstance(made, str):
                left_out[narrative.id] = made
            else:
                records.append(replace(made, attribution=f"{made.attribution}; read by {self._reader.name}"))
        return records, left_out


class NarratedTable(_Source):
    """A register's table with a column of narratives, which complete its other columns."""

    def __init__(self, table: RegisterTable, reader: Reader) -> None:
        self.mapping = table.mapping
        self._table, self._reader = table, reader

    def notes(self) -> list[str]:
        """Return the notes of the table, and notes on unread narratives and unsupported facts."""
        records, unread = self._read
        notes = [*self._table.notes(), f"{count_of(len(self._table.narratives()), 'narrative')} read"]
        return [*notes, *(f"not read: {name}: {why}" for name, why in unread.items()), *_remarks(records)]

    def _read_all(self) -> tuple[list[CrashRecord], dict[str, str]]:
        readings, unread = self._reader.readings(self._table.narratives())
        return [self._with_narrative(each, readings.get(each.key)) for each in self._table.records()], unread

    def _with_narrative(self, coded: CrashRecord, reading: Reading | None) -> CrashRecord:
        if reading is None:
            return coded
        place = Place(coded.latitude_deg, coded.longitude_deg)
        narrated = record_of(Narrative(coded.key, "", str(coded.case_year), place), None, reading, vocabulary())
        if isinstance(narrated, str):
            return coded
        attribution = f"{coded.attribution}; its narratives read by {self._reader.name}"
        return replace(merge_records(coded, narrated), attribution=attribution)


def narratives_in(folder: Path) -> list[Narrative]:
    """Return the text files of a folder, sorted by name.

    Raises :class:`UserError` if there are none.
    """
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder; expected one with narratives, a text file (.txt) for each crash")
    files = sorted(folder.glob("*.txt"))
    if not files:
        raise UserError(f"{folder}: no narratives; expected a text file (.txt) for each crash")
    return [_narrative(file) for file in files]


def _narrative(file: Path) -> Narrative:
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    said: dict[str, str] = {}
    while lines and (match := _HEADER.fullmatch(lines[0].strip())):
        said[match["name"].lower()] = match["value"].strip()
        del lines[0]
    try:
        place = Place(float(said["latitude"]), float(said["longitude"])) if said.keys() >= {"latitude"} else None
    except (KeyError, ValueError) as error:
        raise UserError(f"{file}: latitude and longitude are not both a number of degrees") from error
    return Narrative(file.stem, "\n".join(lines).strip(), said.get("time", ""), place)


def _place_in_words(reading: Reading) -> FromCrossing | None:
    columns = vocabulary().mapping.crash
    assert columns.from_crossing is not None
    street, cross_street = (reading.value(CRASH, str(each)) for each in (columns.trafficway_1, columns.trafficway_2))
    distance = reading.value(CRASH, columns.from_crossing.distance.column)
    direction = reading.value(CRASH, columns.from_crossing.direction.column)
    octant = Octant(direction) if direction else None
    return FromCrossing.said(street, cross_street, parse_measure(distance) if distance else 0.0, octant)


def _remarks(records: Sequence[CrashRecord]) -> list[str]:
    """Return sentences on contradictions and unsupported statements, with the first few crashes by name."""
    remarks = []
    for what, sentences in (
        ("contradictions", [(each.key, said) for each in records for said in each.contradictions]),
        ("not taken, as no words support it", [(each.key, said) for each in records for said in each.ambiguities]),
    ):
        shown = "; ".join(f"{key}: {said.partition(': ')[2]}" for key, said in sentences[:_SHOWN])
        more = f"; and {len(sentences) - _SHOWN} more" if len(sentences) > _SHOWN else ""
        if sentences:
            remarks.append(f"{len(sentences)} {what}: {shown}{more}")
    return remarks


# --- asking ----------------------------------------------------------------------------------------------------------
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
    file = PromptFile.read(resources.files("trace_dag.language.narratives") / f"{question}.md")
    messages = file.messages(values)
    for left in reversed(range(attempts)):
        answer = model.ask(messages, prompt=f"narrative-{question}:{file.digest}", schema=schema)
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
