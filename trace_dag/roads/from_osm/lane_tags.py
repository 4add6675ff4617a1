"""Lanes of a road in each direction, with their attributes, from its tags.

The tags of lanes often contradict each other. The one that comes first in this list is trusted, and a contradiction is
reported:

1. ``oneway``; tags such as ``oneway:bus=no`` add lanes against it.
2. ``lanes:forward``, ``lanes:backward`` and ``lanes:both_ways`` of a road with two directions; ``lanes`` of a one-way
   road.
3. Lists with one entry per lane (``turn:lanes`` and its like), without the entries of lanes that are not for cars or
   buses. A list with more entries than ``lanes`` counts pockets that ``lanes`` leaves out; a shorter one is incomplete.
4. Half of ``lanes`` for each direction of a road with two. If the number is odd, the lane in the middle is a turn
   lane, as is usual in the US.
5. The report's number.
6. The usual number for the road's class.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import compress
from typing import Final, NamedTuple

from trace_dag.common.messages.wording import count_of
from trace_dag.osm.road_classes import CAR_POOLS, road_class
from trace_dag.roads.from_osm.tag_values import (
    MOST_LANES,
    parse_entries,
    parse_integer,
    parse_length_m,
    parse_speed_mps,
    parse_turns,
)

Tags = Mapping[str, str]
_CAR_KEYS: Final = ("motorcar", "motor_vehicle", "vehicle", "access")  # the most particular first
_BUS_KEYS: Final = ("bus", "psv")
_SAYS_LANES: Final = ("turn", "change", "width", "maxspeed")  # lists that say how many lanes there are
_SAYS_WHO: Final = (*_CAR_KEYS, "hov", *_BUS_KEYS, "bicycle", "cycleway")  # and whose they are
_CLOSED: Final = frozenset({"no", "private"})
_OPEN: Final = frozenset({"yes", "designated", "official", "permissive"})
_CONTRAFLOW: Final = frozenset({"opposite_lane", "opposite", "lane:opposite"})
_WIDTHS_M: Final = (2.0, 6.0)  # a tagged width of one lane outside this range is a typing error


class TaggedLane(NamedTuple):
    """The tags of one lane: painted turns (OSM's words), width, limit, lane changes, and whether it is for buses alone.

    ``change:lanes`` has the lane changes.
    """

    turns: tuple[str, ...] = ()
    width_m: float | None = None
    speed_mps: float | None = None
    change: str = ""
    bus: bool = False


@dataclass(frozen=True)
class LaneReading:
    """The lanes of each direction from left to right as its drivers see them, and the turn lane between the two.

    ``tagged``: the number is from the tags. ``shared``: both directions use one lane. ``not_followed`` has a sentence
    for each tag that contradicts another one or cannot be read.
    """

    forward: tuple[TaggedLane, ...]
    backward: tuple[TaggedLane, ...] = ()
    centre: TaggedLane | None = None
    tagged: bool = False
    shared: bool = False
    not_followed: tuple[str, ...] = ()


def read_lanes(tags: Tags, *, oneway: bool, hint: int | None = None) -> LaneReading:
    """Return the lanes of a road whose one-way traffic follows its way; ``hint`` is their number by the report.

    >>> tags = {"lanes": "3", "turn:lanes": "left|through|through|right", "vehicle:lanes": "yes|yes|no|yes"}
    >>> [lane.turns for lane in read_lanes(tags, oneway=True).forward]
    [('left',), ('through',), ('right',)]
    """
    reader = _Reader(tags)
    if not oneway:
        return reader.both_ways(hint)
    against = _lanes_against(tags)
    return reader.contraflow(against) if against else reader.one_way(hint)


def _lanes_against(tags: Tags) -> int:
    """Return the lanes on which buses go against a one-way road."""
    for key in _BUS_KEYS:
        counted = parse_integer(tags.get(f"lanes:{key}:backward"), 1, MOST_LANES)
        listed = parse_entries(tags.get(f"{key}:lanes:backward"))
        if counted or listed:
            return counted or len(listed)
    if any(tags.get(key) in _CONTRAFLOW for key in ("busway", "busway:left", "busway:right")):
        return 1
    if any(tags.get(f"oneway:{key}") == "no" for key in _BUS_KEYS):
        return parse_integer(tags.get("lanes:backward"), 1, MOST_LANES) or 0
    return 0


class _Lists:
    """The tags with one entry per lane of a direction, without entries for lanes of neither cars nor buses."""

    def __init__(self, tags: Tags, *suffixes: str) -> None:
        found = {
            key.removesuffix(suffix): entries
            for suffix in suffixes
            for key, value in tags.items()
            if key.endswith(suffix) and (entries := parse_entries(value))
        }
        who = {key: found[key] for key in _SAYS_WHO if key in found}
        self._bus_only: dict[int, list[bool]] = {}  # by the number of lanes that are left
        masks: dict[int, list[bool]] = {}
        for size in {len(entries) for entries in who.values()}:
            users = [
                _user({key: entries[k] for key, entries in who.items() if len(entries) == size}) for k in range(size)
            ]
            masks[size] = [user != "" for user in users]
            self._bus_only[sum(masks[size])] = [user == "bus" for user in users if user]
        self.entries = {
            key: list(compress(entries, masks.get(len(entries), [True] * len(entries))))
            for key, entries in found.items()
        }
        said = [len(self.entries[key]) for key in _SAYS_LANES if key in self.entries]
        told = [len(self.entries[key]) for key in who]
        self.count = max(said or told, default=0) or None

    def without_buses(self) -> int | None:
        """Return the number of lanes without bus lanes."""
        bus = self._bus_only.get(self.count or 0, [])
        return None if self.count is None else self.count - sum(bus)

    def lanes(self, count: int, note: Callable[[str], None]) -> tuple[TaggedLane, ...]:
        """Return the tags of ``count`` lanes from the lists."""
        bus = self._bus_only.get(self.count or 0, [])
        cars = [not each for each in bus]
        drop = bool(bus) and sum(cars) == count < len(bus)
        fitting = {}
        for key in _SAYS_LANES:
            entries = self.entries.get(key)
            if entries is None:
                continue
            if drop and len(entries) == len(cars):
                entries = list(compress(entries, cars))
            if len(entries) == count:
                fitting[key] = entries
            else:
                note(f"{key}:lanes is for {len(entries)}, not {count}")
        if drop or len(bus) != count:
            bus = [False] * count
        columns = [fitting.get(key, [""] * count) for key in _SAYS_LANES]
        return tuple(
            TaggedLane(parse_turns(turn), _width_m(width), parse_speed_mps(limit), change, only)
            for turn, change, width, limit, only in zip(*columns, bus, strict=True)
        )


def _user(entry: Tags) -> str:
    """Return the user of a lane: "car", "bus", or "" if no motor vehicle may use it."""
    if entry.get("hov") in CAR_POOLS:  # often with "motor_vehicle:lanes=no" for those who are alone in theirs
        return "car"
    car = next((entry[key] for key in _CAR_KEYS if entry.get(key)), "")
    bus = next((entry[key] for key in _BUS_KEYS if entry.get(key)), "")
    if car in _CLOSED:
        return "bus" if bus in _OPEN else ""
    if car:
        return "car"
    if bus == "designated":
        return "bus"
    return "" if entry.get("bicycle") == "designated" or entry.get("cycleway") in ("lane", "track") else "car"


def _width_m(entry: str) -> float | None:
    width_m = parse_length_m(entry)
    return width_m if width_m is not None and _WIDTHS_M[0] <= width_m <= _WIDTHS_M[1] else None


class _Reader:
    """Reads the tags of one road and notes the tags that it ignores."""

    def __init__(self, tags: Tags) -> None:
        self._tags = tags
        self._notes: list[str] = []

    def one_way(self, hint: int | None) -> LaneReading:
        """Return lanes of which all go one way."""
        lists = _Lists(self._tags, ":lanes:forward", ":lanes")
        counted = self._count("lanes") or self._count("lanes:forward")
        count = self._with_pockets(counted, lists) or hint or road_class(self._tags.get("highway", "")).lanes_one_way
        if self._count("lanes:backward") and self._tags.get("oneway:bicycle") != "no":
            self._note("lanes:backward, on a one-way road")
        return LaneReading(
            self._lanes(lists, count, "forward", oneway=True),
            tagged=(counted or lists.count) is not None,
            not_followed=tuple(self._notes),
        )

    def contraflow(self, against: int) -> LaneReading:
        """Return the lanes of a one-way road with bus lanes in the other direction."""
        ahead = _Lists(self._tags, ":lanes:forward")
        back = _Lists(self._tags, ":lanes:backward")
        total = self._count("lanes")
        counted = self._count("lanes:forward") or (None if total is None else max(total - against, 1))
        count = self._with_pockets(counted, ahead) or road_class(self._tags.get("highway", "")).lanes_one_way
        lanes = self._lanes(back, against, "backward")
        return LaneReading(
            self._lanes(ahead, count, "forward"),
            tuple(lane._replace(bus=True) for lane in lanes),
            tagged=(counted or ahead.count) is not None,
            not_followed=tuple(self._notes),
        )

    def both_ways(self, hint: int | None) -> LaneReading:
        """Return lanes of both directions, and one between them."""
        ahead = _Lists(self._tags, ":lanes:forward")
        back = _Lists(self._tags, ":lanes:backward")
        total, reversible = self._count("lanes"), self._reversible_lanes()
        centre = self._has_centre_lane() and not reversible
        named = self._count("lanes:forward"), self._count("lanes:backward")
        listed = ahead.count, back.count
        if total is not None and all(listed) and not any(named) and sum(filter(None, listed)) + centre < total - 1:
            listed = None, None  # one of them is not complete
        forward, backward = named[0] or listed[0], named[1] or listed[1]
        if reversible and (total or (forward and backward)):
            others = max((total or 0) - reversible, 2)
            backward = backward or max(others - forward if forward else others // 2, 1)
            forward = (forward or max(others - backward, 1)) + reversible
            self._note(f"{count_of(reversible, 'lane')} in the middle, reversible or for overtaking: which way unknown")
        silent = not (total or forward or backward)
        counts = _split(hint if silent else total, forward, backward, centre)
        if total not in (None, 1, sum(counts)):
            self._note(f"lanes={total}, since the lanes of each direction add up to {sum(counts)}")
        middle = self._lanes(_Lists(self._tags, ":lanes:both_ways"), 1, "both_ways")[0] if counts[2] else None
        return LaneReading(
            self._lanes(ahead, counts[0], "forward"),
            self._lanes(back, counts[1], "backward"),
            middle,
            tagged=total is not None or (forward is not None and backward is not None),
            shared=total == 1 and counts[:2] == (1, 1),
            not_followed=tuple(self._notes),
        )

    def _with_pockets(self, counted: int | None, lists: _Lists) -> int | None:
        """Return the number of lanes by the count and the lists of one direction."""
        if counted is None or lists.count is None or counted >= lists.count or counted == lists.without_buses():
            return counted if counted is not None else lists.count
        self._note(f"{counted} lanes, since {lists.count} are listed one by one")
        return lists.count

    def _count(self, key: str) -> int | None:
        return parse_integer(self._tags.get(key), 1, MOST_LANES)

    def _reversible_lanes(self) -> int:
        """Return the middle lanes with alternating direction, or for overtaking from both directions."""
        tagged = self._count("lanes:reversible")
        listed = "reversible" in self._tags.get("turn:lanes:both_ways", "")
        overtaking = self._tags.get("overtaking:lanes:both_ways", "no") == "yes"
        return tagged or int(listed or overtaking)

    def _has_centre_lane(self) -> bool:
        both = parse_integer(self._tags.get("lanes:both_ways"), 0, MOST_LANES)
        if both is not None:
            return both > 0
        turns = self._tags.get("turn:lanes:both_ways", "none")
        return self._tags.get("centre_turn_lane") == "yes" or turns not in ("none", "")

    def _lanes(self, lists: _Lists, count: int, direction: str, *, oneway: bool = False) -> tuple[TaggedLane, ...]:
        lanes = lists.lanes(count, lambda what: self._note(f"{what} lanes {direction}"))
        turn = self._tags.get(f"turn:{direction}") or (self._tags.get("turn", "") if oneway else "")
        if turn and "|" not in turn and count == 1 and not lanes[0].turns:
            lanes = (lanes[0]._replace(turns=parse_turns(turn)),)
        elif turn and not any(lane.turns for lane in lanes):
            self._note(f"turn={turn} without a lane, for {count} lanes {direction}")
        first, last = self._bus_lanes(count, direction, oneway=oneway)
        if (first or last) and not any(lane.bus for lane in lanes):
            lanes = tuple(lane._replace(bus=lane.bus or k < first or k >= count - last) for k, lane in enumerate(lanes))
        return lanes

    def _bus_lanes(self, count: int, direction: str, *, oneway: bool) -> tuple[int, int]:
        """Return the bus lanes at the left and (usually) at the right of a direction."""
        tags = self._tags
        for bus in _BUS_KEYS:
            if number := parse_integer(tags.get(f"lanes:{bus}:{direction}"), 1, count - 1):
                return 0, number
            total = parse_integer(tags.get(f"lanes:{bus}"), 1, MOST_LANES) or 0
            if number := total if oneway else total // 2:
                return 0, min(number, count - 1)
        sides = {"right" if direction == "forward" else "left", "both"}
        kerb = any(tags.get(key) == "lane" for key in ("busway", *(f"busway:{side}" for side in sides)))
        return int(oneway and tags.get("busway:left") == "lane" and count > 1), int(kerb and count > 1)

    def _note(self, sentence: str) -> None:
        self._notes.append(sentence)


def _split(total: int | None, forward: int | None, backward: int | None, centre: bool) -> tuple[int, int, int]:
    """Return the numbers of lanes forward, backward and between, from the known counts."""
    if forward is not None and backward is not None:
        return forward, backward, int(centre or total == forward + backward + 1)
    if total is None:
        return forward or 1, backward or 1, int(centre)
    rest = total - int(centre)
    if forward is not None:
        return forward, max(rest - forward, 1), int(centre)
    if backward is not None:
        return max(rest - backward, 1), backward, int(centre)
    if rest >= 3 and rest % 2 and not centre:
        return rest // 2, rest // 2, 1  # three or five lanes both ways: in the US the middle one is for turning
    return max(rest - rest // 2, 1), max(rest // 2, 1), int(centre)
