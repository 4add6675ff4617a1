"""All perturbations, each with a name, the words of a table, and what it needs beside the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final, TypeAlias

from trace_dag.crash.record import Movement
from trace_dag.verdict.perturbed import crash, vehicles
from trace_dag.verdict.perturbed.report import ChangedReport
from trace_dag.verdict.perturbed.scene import Scene

Change: TypeAlias = Callable[[ChangedReport, Scene], str | None]
"""Changes a report in place and says in words what was changed; None where that does not apply to the crash."""


class Needs(StrEnum):
    """What a perturbation takes beside the crash's own report."""

    NOTHING = "nothing"
    OTHER_REPORT = "other_report"
    OTHER_STREET = "other_street"  # a point of the map on another street
    SAME_STREET = "same_street"  # a point of the map on the crash's street, far away


@dataclass(frozen=True)
class Kind:
    """One perturbation. ``drawn``: another draw gives another report. ``moves``: the place is another one."""

    name: str
    title: str
    change: Change
    needs: Needs = Needs.NOTHING
    drawn: bool = False
    moves: bool = False


@dataclass(frozen=True)
class Changed:
    """A changed report, and what was changed in words."""

    xml: bytes
    detail: str


def perturb(kind: Kind, report: bytes, scene: Scene) -> Changed | None:
    """The changed report; None where the perturbation does not apply or changes nothing.

    ``report`` is another crash's for a kind that needs one. Raises :class:`~trace_dag.errors.Rejection` for data that
    is no report.
    """
    changed = ChangedReport(report)
    before = changed.to_bytes()
    detail = kind.change(changed, scene)
    after = changed.to_bytes()
    if detail is None or (after == before and kind is not NOTHING):
        return None
    return Changed(after, detail)


def _nothing(_report: ChangedReport, _scene: Scene) -> str:
    """The report as it is: the control of the controls."""
    return "nothing"


NOTHING: Final = Kind("nothing", "nothing", _nothing)
_STRAIGHT: Final = (Movement.GOING_STRAIGHT, Movement.NEGOTIATING_CURVE)


def _clocks() -> Iterator[Kind]:
    turn = vehicles.turn_clocks
    for hours in (1, 2, 3, 4, 6):
        yield Kind(f"clock_{hours}h", f"clock of vehicle 1 by {hours} h", partial(turn, hours=hours, both=False))
    for hours in (3, 4, 6):
        yield Kind(f"clocks_{hours}h", f"clocks of both by {hours} h", partial(turn, hours=hours, both=True))
    yield Kind("clocks_swapped", "clocks swapped", vehicles.swap_clocks)
    yield Kind("clocks_mirrored", "clocks mirrored", vehicles.mirror_clocks)
    yield Kind("clocks_random", "clocks random", vehicles.random_clocks, drawn=True)


def _movements() -> Iterator[Kind]:
    left, right = Movement.TURNING_LEFT, Movement.TURNING_RIGHT
    for name, title, to in (
        ("left_for_right", "left for right", {left: right, right: left}),
        ("straight_for_left", "straight for left", dict.fromkeys((left, right), Movement.GOING_STRAIGHT)),
        ("left_for_straight", "left for straight", dict.fromkeys(_STRAIGHT, left)),
        ("both_u_turn", "both U-turn", dict.fromkeys(Movement, Movement.U_TURN)),
        ("both_backing", "both backing", dict.fromkeys(Movement, Movement.BACKING)),
    ):
        yield Kind(name, title, partial(vehicles.change_movements, to=to))


def _speeds() -> Iterator[Kind]:
    yield Kind("speeds_swapped", "speeds swapped", vehicles.swap_speeds)
    for mph in (0, 1, 150):
        yield Kind(f"speeds_{mph}", f"speeds {mph} mph", partial(vehicles.set_speeds, mph=mph))


def _places() -> Iterator[Kind]:
    for far_m in (10, 30, 100, 300, 1000):
        for way, east, north in (("n", 0, 1), ("e", 1, 0), ("s", 0, -1), ("w", -1, 0)):
            change = partial(crash.move, east_m=far_m * east, north_m=far_m * north)
            yield Kind(f"moved_{far_m}m_{way}", f"moved {far_m} m {way.upper()}", change, moves=True)


def _crash_types() -> Iterator[Kind]:
    for name, title, codes in (
        ("single", "single vehicle, both", (1, 1)),
        ("head_on", "head-on", (50, 51)),
        ("left_across", "left across", (68, 69)),
        ("crossing_right", "crossing 86/87", (86, 87)),
        ("crossing_left", "crossing 88/89", (88, 89)),
        ("backing", "backing", (92, 93)),
    ):
        yield Kind(f"type_{name}", f"crash type: {title}", partial(vehicles.set_crash_types, codes=codes))
    yield Kind("types_swapped", "crash types swapped", vehicles.swap_crash_types)


def _what_happened() -> Iterator[Kind]:
    yield Kind("manner_rear_to_rear", "manner: rear to rear", partial(crash.set_manner, code=10))
    yield Kind("manner_front_to_front", "manner: front to front", partial(crash.set_manner, code=2))
    yield Kind("tree_harm", "first harmful event: a tree", crash.tree_as_first_harm)
    yield Kind("tree_event", "first event: a tree", crash.tree_as_first_event)
    partner_stays = partial(crash.tree_as_first_event, partner_stays=True)
    yield Kind("tree_event_code", "first event: a tree, code alone", partner_stays)


def _streets() -> Iterator[Kind]:
    names = crash.made_up_names
    yield Kind("name_made_up", "street name made up", partial(names, elements=("TWAY_ID",)), drawn=True)
    both = partial(names, elements=("TWAY_ID", "TWAY_ID2"))
    yield Kind("names_made_up", "both street names made up", both, drawn=True)
    yield Kind("name_i999", "street name I-999", partial(crash.name_street, name="I-999"))
    for name, title, kind, junction in (
        ("none", "none", 1, 1),
        ("four_way", "four-way", 2, 2),
        ("roundabout", "roundabout", 6, 2),
        ("five_arms", "five arms", 7, 2),
    ):
        change = partial(crash.set_intersection, kind=kind, junction=junction)
        yield Kind(f"intersection_{name}", f"intersection: {title}", change)


def _road() -> Iterator[Kind]:
    road = crash.set_road
    yield Kind(
        "road_interstate", "class, lanes, limit: interstate", partial(road, interstate=True, lanes=6, limit_mph=70)
    )
    yield Kind("class_interstate", "class of an interstate", partial(road, interstate=True))
    yield Kind("lanes_6", "six lanes", partial(road, lanes=6))
    yield Kind("lanes_1", "one lane", partial(road, lanes=1))
    yield Kind("limit_70", "limit 70 mph", partial(road, limit_mph=70))
    yield Kind("alignment_mirrored", "alignment mirrored", crash.mirror_alignment)
    yield Kind("alignment_other", "curved for straight, straight for curved", crash.other_alignment)


def _whole_reports() -> Iterator[Kind]:
    yield Kind("bodies", "bodies: bus and motorcycle", partial(vehicles.set_bodies, codes=(52, 80)))
    yield Kind("vehicles_random", "all about the vehicles random", vehicles.random_vehicles, drawn=True)
    yield Kind("blank", "blank but for the place", crash.blank)
    yield Kind("blank_head_on", "blank but for place, head-on types", partial(crash.blank, head_on=True))
    named = partial(crash.blank, head_on=True, named=True)
    yield Kind("blank_head_on_named", "blank but for place, names, head-on types", named)


def _elsewhere() -> Iterator[Kind]:
    other = Needs.OTHER_REPORT
    own, here = partial(crash.set_down, named_here=False), partial(crash.set_down, named_here=True)
    yield Kind("foreign_site", "foreign site", own, other, drawn=True)
    yield Kind("foreign_site_named_here", "foreign site, names of this site", here, other, drawn=True)
    for name, title, needs in (
        ("random_point_other_street", "random point, another street", Needs.OTHER_STREET),
        ("random_point_same_street", "random point, same street", Needs.SAME_STREET),
    ):
        yield Kind(name, title, crash.at_point, needs, drawn=True, moves=True)


KINDS: Final[dict[str, Kind]] = {
    kind.name: kind
    for kinds in (
        *([NOTHING], _clocks(), _movements(), _speeds(), _places(), _crash_types(), _what_happened()),
        *(_streets(), _road(), _whole_reports(), _elsewhere()),
    )
    for kind in kinds
}
"""Every perturbation by its name, in the order of the table."""
