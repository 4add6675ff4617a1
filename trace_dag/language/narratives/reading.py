"""A model's reading of a narrative, limited to facts that the words support and nothing contradicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from trace_dag.language.narratives.vocabulary import CRASH, Vocabulary

_LONGEST: Final = 1000  # characters
_MOST: Final = 500


class _Form(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class Fact(_Form):
    """A value that a narrative gives to a field of a unit, or of the crash (unit 0), and the words that say so."""

    unit: int = Field(ge=0, le=99)
    field: str = Field(max_length=_LONGEST)
    value: str = Field(max_length=_LONGEST)
    words: str = Field(max_length=_LONGEST)

    @property
    def claim(self) -> str:
        """Return the fact as a statement."""
        return f"{_unit(self.unit)}: {self.field}: {self.value}"


class NarrativeEvent(_Form):
    """An event of the sequence, by unit or between two, and the words that say so."""

    event: str = Field(max_length=_LONGEST)
    unit: int = Field(ge=1, le=99)
    other_unit: int | None = Field(None, ge=1, le=99)
    area: str | None = Field(None, max_length=_LONGEST)
    other_area: str | None = Field(None, max_length=_LONGEST)
    words: str = Field(max_length=_LONGEST)

    @property
    def claim(self) -> str:
        """Return the event as a statement."""
        whom = "" if self.other_unit is None else f", with unit {self.other_unit}"
        areas = [f"struck on the {area}" for area in (self.area,) if area]
        areas += [f"unit {self.other_unit} struck on the {area}" for area in (self.other_area,) if area]
        return f"unit {self.unit} {self.event}{whom}{''.join(f', {each}' for each in areas)}"


class Answer(_Form):
    """A model's answer to the first question."""

    facts: list[Fact] = Field(max_length=_MOST)
    events: list[NarrativeEvent] = Field(max_length=_MOST)


class Support(_Form):
    """A model's answer to the second question: the numbers of the statements that their words support."""

    supported: list[int]


@dataclass(frozen=True)
class Reading:
    """The supported facts of a narrative.

    ``contradictions`` name fields with two values in the narrative, neither of which is used; ``not_taken`` names
    statements of the model without supporting words. Both are sentences.
    """

    facts: tuple[Fact, ...] = ()
    events: tuple[NarrativeEvent, ...] = ()
    contradictions: tuple[str, ...] = ()
    not_taken: tuple[str, ...] = ()

    def value(self, unit: int, label: str) -> str:
        """Return the value of a field; "" if the narrative does not give it."""
        return next((fact.value for fact in self.facts if (fact.unit, fact.field) == (unit, label)), "")


def complaint_about(said: Fact | NarrativeEvent, narrative: str, known: Vocabulary) -> str | None:
    """Return a sentence on the fault of a fact or event.

    None if it is in the vocabulary and its words are in the narrative.

    >>> from trace_dag.language.narratives.vocabulary import vocabulary
    >>> fact = Fact(unit=1, field="movement", value="turning left", words="turned left")
    >>> complaint_about(fact, "V1 turned right.", vocabulary())
    "unit 1: movement: turning left: the words 'turned left' do not stand in the narrative"
    """
    wrong = _not_in_vocabulary(said, known)
    if wrong is not None:
        return f"{said.claim}: {wrong}"
    if not _plain(said.words) or _plain(said.words) not in _plain(narrative):
        return f"{said.claim}: the words {said.words!r} do not stand in the narrative"
    return None


def _not_in_vocabulary(said: Fact | NarrativeEvent, known: Vocabulary) -> str | None:
    if isinstance(said, Fact):
        field = known.field(said.unit, said.field)
        if field is None:
            return f"there is no field {said.field!r} of {'the crash' if said.unit == CRASH else 'a unit'}"
        return field.complaint(said.value)
    if said.event not in known.events:
        return f"there is no event {said.event!r}"
    unknown = [area for area in (said.area, said.other_area) if area is not None and area not in known.areas]
    return f"there is no area {unknown[0]!r}" if unknown else None


def _plain(text: str) -> str:
    return " ".join(text.split())


def _unit(number: int) -> str:
    return "the crash" if number == CRASH else f"unit {number}"


def drop_contradictions(reading: Reading) -> Reading:
    """Return the reading without fields that have two values; these are named in ``contradictions``.

    >>> facts = [Fact(unit=1, field="movement", value=each, words=each) for each in ("backing", "stopped")]
    >>> drop_contradictions(Reading(tuple(facts))).contradictions
    ("unit 1: movement is backing ('backing') and stopped ('stopped')",)
    """
    by_field: dict[tuple[int, str], dict[str, Fact]] = {}
    for fact in reading.facts:
        by_field.setdefault((fact.unit, fact.field), {}).setdefault(fact.value, fact)
    sentences = [
        f"{_unit(unit)}: {label} is " + " and ".join(f"{each.value} ({each.words!r})" for each in values.values())
        for (unit, label), values in by_field.items()
        if len(values) > 1
    ]
    kept = tuple(next(iter(values.values())) for values in by_field.values() if len(values) == 1)
    return replace(reading, facts=kept, contradictions=(*reading.contradictions, *sentences))
