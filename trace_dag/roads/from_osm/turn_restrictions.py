"""Turn restrictions of OpenStreetMap, read from its relations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from trace_dag.osm.types import OsmExtract, OsmRelation
from trace_dag.roads.from_osm.movements import TurnRestrictions

_TURNS: Final = ("left_turn", "right_turn", "straight_on", "u_turn")
_KINDS: Final = frozenset({f"{kind}_{turn}" for kind in ("no", "only") for turn in _TURNS} | {"no_entry", "no_exit"})


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


def _paths(relation: OsmRelation, aliases: Mapping[int, int]) -> list[tuple[int, int | tuple[int, ...], int]]:
    ways: dict[str, list[int]] = {"from": [], "to": [], "via": []}
    via_nodes: list[int] = []
    for member in relation.members:
        if member.type == "way" and member.role in ways:
            ways[member.role].append(member.id)
        elif member.type == "node" and member.role == "via":
            via_nodes.append(aliases.get(member.id, member.id))
    via: int | tuple[int, ...]
    if via_nodes:
        via = via_nodes[0]
    elif ways["via"]:
        via = tuple(ways["via"])
    else:
        return []
    return [(origin, via, target) for origin in ways["from"] for target in ways["to"]]
