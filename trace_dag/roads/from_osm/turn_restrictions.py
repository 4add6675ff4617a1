"""Turn restrictions of OpenStreetMap, read from its relations."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Final, TypeAlias

from trace_dag.osm.types import OsmExtract, OsmRelation

_Via: TypeAlias = int | tuple[int, ...]
_TURNS: Final = ("left_turn", "right_turn", "straight_on", "u_turn")
_KINDS: Final = frozenset({f"{kind}_{turn}" for kind in ("no", "only") for turn in _TURNS} | {"no_entry", "no_exit"})


class TurnRestrictions:
    """Turn restrictions by way and node. ``via`` is a node or the ids of the ways between."""

    def __init__(self) -> None:
        self._forbidden: set[tuple[int, _Via, int]] = set()
        self._only: dict[tuple[int, _Via], set[int]] = defaultdict(set)

    def add(self, origin: int, via: _Via, target: int, *, only: bool) -> None:
        """Add one restriction: from way, via, to way; ``only`` for the only_* kinds."""
        if only:
            self._only[origin, via].add(target)
        else:
            self._forbidden.add((origin, via, target))

    def permits(self, ways: Sequence[int], nodes: Sequence[int]) -> bool:
        """Return whether a path along ``ways``, meeting at ``nodes`` (one fewer), respects all restrictions."""
        steps: list[tuple[int, _Via, int]] = list(zip(ways[:-1], nodes, ways[1:], strict=True))
        for first, last in combinations(range(len(ways)), 2):
            if last - first > 1:
                steps.append((ways[first], tuple(ways[first + 1 : last]), ways[last]))
        return not any(
            (origin, via, target) in self._forbidden or target not in self._only.get((origin, via), {target})
            for origin, via, target in steps
        )


def unknown_kinds(extract: OsmExtract) -> Iterator[tuple[int, str]]:
    """Yield relations of unknown kind, which are left out: their first way, and a sentence."""
    for relation in extract.relations:
        kind = relation.tags.get("restriction", "")
        if kind not in _KINDS:
            origins = [member.id for member in relation.members if member.role == "from"]
            yield next(iter(origins), 0), f"restriction={kind} of relation {relation.id}, which is not known"


def read_restrictions(extract: OsmExtract, aliases: Mapping[int, int]) -> TurnRestrictions:
    """Return the restrictions of an extract that hold at the time of the crash."""
    restrictions = TurnRestrictions()
    for relation in extract.relations:
        kind = relation.tags.get("restriction", "")
        if kind in _KINDS:
            for origin, via, target in _paths(relation, aliases):
                restrictions.add(origin, via, target, only=kind.startswith("only_"))
    return restrictions


def _paths(relation: OsmRelation, aliases: Mapping[int, int]) -> list[tuple[int, _Via, int]]:
    ways: dict[str, list[int]] = {"from": [], "to": [], "via": []}
    via_nodes: list[int] = []
    for member in relation.members:
        if member.type == "way" and member.role in ways:
            ways[member.role].append(member.id)
        elif member.type == "node" and member.role == "via":
            via_nodes.append(aliases.get(member.id, member.id))
    via: _Via
    if via_nodes:
        via = via_nodes[0]
    elif ways["via"]:
        via = tuple(ways["via"])
    else:
        return []
    return [(origin, via, target) for origin in ways["from"] for target in ways["to"]]
