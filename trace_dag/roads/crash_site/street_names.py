"""Comparison of American street names: ``SR-41/FRANKLIN TRNPK`` and ``Franklin Turnpike``, ``VA 41``.

Police write abbreviations and route numbers, OpenStreetMap writes names out and puts numbers into ``ref``. A text is
split into route numbers (system and number) and plain names (core words, type, directions). Two texts are as alike
as their best pair of routes or names. Abbreviations of street types and directions are those of the US Postal
Service's Publication 28 (appendices B and C1), as far as FARS and OSM use them, and a few that police use."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from enum import StrEnum
from functools import lru_cache
from typing import Final

from trace_dag.common.data_files import read_toml


class RouteSystem(StrEnum):
    """Systems of numbered routes: federal, state, county, ..."""

    INTERSTATE = "interstate"
    US = "us"
    STATE = "state"
    COUNTY = "county"
    OTHER = "other"  # townships, municipalities, forests, reservations
    UNKNOWN = "unknown"  # "Route 175", "Highway 61"


@dataclass(frozen=True)
class NumberedRoute:
    """A numbered route. ``variant`` is "business", "alternate", ..., or empty for the route itself."""

    system: RouteSystem
    number: str
    variant: str = ""


@dataclass(frozen=True)
class PlainName:
    """A street name in words: ``core`` without type and directions, all upper case and written out."""

    core: tuple[str, ...]
    type: str = ""
    directions: tuple[str, ...] = ()


@dataclass(frozen=True)
class StreetName:
    """All routes and names of one text."""

    routes: tuple[NumberedRoute, ...]
    names: tuple[PlainName, ...]
    ramp: bool = False


SAME_STREET: Final = 0.8
"""Similarity from which two names are taken for those of one street."""
OTHER_STREET: Final = 0.4
"""Similarity below which two names are those of two streets: judgement."""


_WORDS_OF: Final[dict[str, dict[str, list[str]]]] = read_toml("trace_dag.roads.crash_site", "street_words.toml")


def _spelled_out(section: str) -> dict[str, str]:
    """Return what is written out by each of its abbreviations, in a section of ``street_words.toml``."""
    return {short: full for full, abbreviations in _WORDS_OF[section].items() for short in abbreviations}


_SYSTEMS: Final = {short: RouteSystem(system) for short, system in _spelled_out("systems").items()}
_STATES: Final = (
    "AL AK AZ AR CA CO CT DE DC FL GA HI IA ID IL IN KS KY LA MA MD ME MI MN MO MS MT NC ND NE NH NJ NM NV NY OH OK OR "
    "PA PR RI SC SD TN TX UT VA VT WA WI WV WY"
)
_VARIANTS: Final = _spelled_out("variants")
_TYPES: Final = {full: full for full in _WORDS_OF["types"]} | _spelled_out("types")
_DIRECTIONS: Final = {full: full for full in _WORDS_OF["directions"]} | _spelled_out("directions")
_WORDS: Final = _spelled_out("words")
_PLACEHOLDERS: Final = frozenset({"UNNAMED", "UNAMED", "UNKNOWN", "PRIVATE", "NONE"})
_BLOCK: Final = frozenset({"BLK", "BLOCK", "OF"})
_LEAST_ADDRESS: Final = 100
_NO_NAMES: Final = frozenset((*_TYPES, *_VARIANTS, *_DIRECTIONS, *_PLACEHOLDERS))
_RAMP: Final = re.compile(r"\bRAMPS?\b")
_ORDINAL: Final = re.compile(r"^(\d+)(?:ST|ND|RD|TH)$")
_SYSTEM_PATTERN: Final = "|".join(
    word.replace(" ", r"[\s-]+") for word in sorted((*_SYSTEMS, *_STATES.split()), key=len, reverse=True)
)
_ROUTE: Final = re.compile(
    rf"\b(?P<system>{_SYSTEM_PATTERN})[\s-]*(?P<number>\d+)(?P<letter>[A-Z]?)\b"
    rf"(?:[\s-]+(?P<variant>{'|'.join(_VARIANTS)})\b)?"
)
_BARE_SYSTEM: Final = re.compile(r"^(?:CR|MU|LS|SR|TR|CO|PR|OT)\s*-\s*(?=[A-Z]|\d+(?:ST|ND|RD|TH)\b)")
"""A system without a number: "CR-ROSS ROAD", "CR-128TH AVE"."""
_LIKE_ENOUGH: Final = 0.84  # two spellings with at least this share of equal letters are one name with a typing error
_SHORTEST_MISSPELT: Final = 5  # letters: shorter names that differ are different names


@lru_cache(maxsize=4096)
def parse_street(text: str) -> StreetName:
    """Return the routes and names in a text.

    Parts divided by ``/``, ``;``, ``,``, ``(`` or ``@`` are names of the same street.

    >>> parse_street('N MAIN ST').names[0].core
    ('MAIN',)
    """
    upper = text.upper().replace("½", " 1/2").replace("U.S.", "US").replace("&AMP;", "&")
    upper = re.sub(r"(?<=\d) ?1/2", " HALF", upper)
    routes: dict[NumberedRoute, None] = {}
    names: dict[PlainName, None] = {}
    ramp = bool(_RAMP.search(upper))
    for part in re.split(r"[/;,()@|]", _RAMP.sub(" ", upper)):
        rest = part.strip()
        for match in _ROUTE.finditer(rest):
            routes[_route(match)] = None
        rest = _BARE_SYSTEM.sub("", _ROUTE.sub(" ", rest).strip())
        name = _plain_name(rest)
        # "INTERSTATE 283 RD" or "US 60 E": the words left beside the route are a type or a direction, not a name.
        if name is not None:
            names[name] = None
    return StreetName(tuple(routes), tuple(names), ramp)


def similarity(reported: str, mapped: Iterable[str]) -> float | None:
    """Score the fit of a reported street to the names of a mapped one, from 0 (another street) to 1 (the same).

    None if the two cannot be compared: one has only names and the other only route numbers, or one has neither.

    >>> similarity("SR-41/FRANKLIN TRNPK", ["Franklin Turnpike"])
    1.0
    >>> similarity("MAIN ST", ["US 1"]) is None
    True
    """
    wanted = parse_street(reported)
    best: float | None = None
    for text in mapped:
        value = _similarity(wanted, parse_street(text))
        if value is not None and (best is None or value > best):
            best = value
    return best


def best_similarity(reported: Iterable[str], mapped: Collection[str]) -> float | None:
    """Score the fit of the best of several reported streets, as :func:`similarity`; None if none can be compared.

    >>> best_similarity(["MAIN ST", "SR-41"], ["Elder Street", "Main Street"])
    1.0
    """
    return max((value for each in reported if (value := similarity(each, mapped)) is not None), default=None)


def is_same_street(reported: str, mapped: Iterable[str]) -> bool:
    """Return whether a reported street is that of the mapped names.

    >>> is_same_street("MAIN ST", ["US 1", "Main Street"]), is_same_street("MAIN ST", ["US 1"])
    (True, False)
    """
    return (similarity(reported, mapped) or 0.0) >= SAME_STREET


class StreetIndex:
    """An index of a map's streets by all their names, for reported names."""

    def __init__(self, mapped: Iterable[tuple[str, ...]]) -> None:
        self._streets = {names: [parse_street(text) for text in names] for names in mapped}
        self._by_key: dict[object, list[tuple[str, ...]]] = {}
        for names, parsed in self._streets.items():
            for key in {key for each in parsed for key in _keys(each)}:
                self._by_key.setdefault(key, []).append(names)

    def same(self, reported: str) -> list[tuple[str, ...]]:
        """Return the streets of a reported name: those with the same spelling, or else those with a typing error.

        >>> StreetIndex([("Elder Street",), ("Main Street", "US 1"), ("Maine Road",)]).same("N MAIN ST")
        [('Main Street', 'US 1')]
        """
        wanted = parse_street(reported)
        alike = dict.fromkeys(names for key in _keys(wanted) for names in self._by_key.get(key, ()))
        return self._same(wanted, alike) or self._same(wanted, self._streets)

    def _same(self, wanted: StreetName, among: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
        return [
            names
            for names in among
            if any((_similarity(wanted, each) or 0.0) >= SAME_STREET for each in self._streets[names])
        ]


def _keys(name: StreetName) -> Iterator[object]:
    """Yield the keys that two spellings of one street share without a typing error.

    A key is a route's number, or all words.
    """
    yield from (route.number for route in name.routes)
    for each in name.names:
        yield "".join(each.core)
        yield frozenset(each.core)


def _similarity(a: StreetName, b: StreetName) -> float | None:
    values = [_route_similarity(x, y) for x in a.routes for y in b.routes]
    values += [_name_similarity(x, y) for x in a.names for y in b.names]
    return max(values, default=None)


def _route_similarity(a: NumberedRoute, b: NumberedRoute) -> float:
    if a.number != b.number:
        return 0.0
    if a.system == b.system:
        value = 1.0
    elif RouteSystem.UNKNOWN in (a.system, b.system):
        value = 0.9
    elif {a.system, b.system} == {RouteSystem.STATE, RouteSystem.COUNTY}:
        value = 0.6  # secondary state roads are often called county roads, and the other way round
    else:
        return 0.0
    return value if a.variant == b.variant else value * 0.5


def _name_similarity(a: PlainName, b: PlainName) -> float:
    value = _core_similarity(a.core, b.core)
    if a.type != b.type:
        value *= 0.85 if a.type and b.type else 0.95
    if a.directions != b.directions:
        value *= 0.8 if a.directions and b.directions else 0.97
    return value


def _core_similarity(a: tuple[str, ...], b: tuple[str, ...]) -> float:
    if a == b:
        return 1.0
    joined_a, joined_b = "".join(a), "".join(b)
    if joined_a == joined_b:  # "Oak Wood" and "Oakwood"
        return 0.98
    digits = [re.findall(r"\d+", joined) for joined in (joined_a, joined_b)]
    shorter, longer = sorted((len(joined_a), len(joined_b)))
    if digits[0] == digits[1] and shorter >= _SHORTEST_MISSPELT and 2 * shorter >= _LIKE_ENOUGH * (shorter + longer):
        ratio = SequenceMatcher(None, joined_a, joined_b, autojunk=False).ratio()
        if ratio >= _LIKE_ENOUGH:
            return 0.9 * ratio
    common = len(set(a) & set(b))
    share = common / max(len(set(a)), len(set(b)))
    return 0.8 * share if share > 0.5 else 0.0  # "George Washington Memorial" and "George Washington"


def _route(match: re.Match[str]) -> NumberedRoute:
    word = re.sub(r"[\s-]+", " ", match["system"])
    variant = _VARIANTS.get(match["variant"] or "", "")
    letter = "" if match["letter"] in _DIRECTIONS else match["letter"]  # "SR-63S" is State Route 63, southbound
    return NumberedRoute(_SYSTEMS.get(word, RouteSystem.STATE), match["number"] + letter, variant)


def _plain_name(text: str) -> PlainName | None:
    tokens = [token for token in re.split(r"[^A-Z0-9']+", text) if token]
    tokens = _without_address([token.replace("'", "") for token in tokens])
    if len(tokens) > 1 and tokens[0] == "ST" and tokens[1] not in _DIRECTIONS:
        tokens[0] = "SAINT"
    directions, tokens = _take_directions(tokens)
    kind = ""
    if len(tokens) > 1 and tokens[-1] in _TYPES:
        kind = _TYPES[tokens.pop()]
    elif len(tokens) > 1 and tokens[0] in _TYPES:  # "AVENUE G"
        kind = _TYPES[tokens.pop(0)]
    core = tuple(word for token in tokens for word in _written_out(token).split())
    if not core or (len(core) == 1 and core[0] in (_NO_NAMES if not kind else _PLACEHOLDERS)):
        return None
    return PlainName(core, kind, directions)


def _without_address(tokens: list[str]) -> list[str]:
    """Return a name without a leading number of a house or block: "4300 BLK OF WISCONSIN AVE NW".

    Numbers below 100 are names ("12 MILE RD"), and so are numbers before a type ("142 STREET").
    """
    if len(tokens) < 2 or not tokens[0].isdecimal() or int(tokens[0]) < _LEAST_ADDRESS or tokens[1] in _TYPES:
        return tokens
    rest = tokens[1:]
    while len(rest) > 1 and rest[0] in _BLOCK:
        rest = rest[1:]
    return rest


def _take_directions(tokens: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return the directions before and after a name, and the rest.

    A direction stays if only a type would be left ("North Street", "Avenue E").
    """
    directions: list[str] = []
    rest = list(tokens)
    if len(rest) > 1 and rest[0] in _DIRECTIONS and not (len(rest) == 2 and rest[1] in _TYPES):
        directions.append(_DIRECTIONS[rest.pop(0)])
    if len(rest) > 1 and rest[-1] in _DIRECTIONS and not (len(rest) == 2 and rest[0] in _TYPES):
        directions.append(_DIRECTIONS[rest.pop()])
    return tuple(sorted(directions)), rest


def _written_out(token: str) -> str:
    if match := _ORDINAL.match(token):
        return match[1]
    return _WORDS.get(token, token)
