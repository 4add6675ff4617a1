"""All perturbations, each with a name, the words of a table, and what it needs beside the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final, TypeAlias

from lab.changed_reports import crash, people, vehicles
from lab.changed_reports.report import ChangedReport
from lab.changed_reports.scene import PerturbedScene
from trace_dag.common.errors import Rejection
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, PreCrashMovement

Change: TypeAlias = Callable[[ChangedReport, PerturbedScene], str | None]
"""Changes a report in place and says in words what was changed; None where that does not apply to the crash."""


def begins_with(record: CrashRecord) -> EventKind | None:
    """Return the kind of the first harmful event of a crash; None if the report does not tell the sequence."""
    try:
        return sequence_of(record).first.kind
    except Rejection:
        return None


class Needs(StrEnum):
    """Inputs of a perturbation beside the crash's own report."""

    NOTHING = "nothing"
    OTHER_REPORT = "other_report"
    OTHER_STREET = "other_street"  # a point of the map on another street
    SAME_STREET = "same_street"  # a point of the map on the crash's street, far away


_COLLISIONS: Final = frozenset({EventKind.VEHICLE_CONTACT})
_STRIKES: Final = frozenset({EventKind.PERSON_STRUCK})
PERTURBED: Final = _COLLISIONS | _STRIKES
"""First events of crashes whose reports are changed."""


@dataclass(frozen=True)
class PerturbationKind:
    """One perturbation. ``drawn``: another draw gives another report. ``moves``: the place is another one. ``of``: what
    the crashes begin with whose reports it changes."""

    name: str
    title: str
    change: Change
    needs: Needs = Needs.NOTHING
    drawn: bool = False
    moves: bool = False
    of: frozenset[EventKind] = _COLLISIONS


@dataclass(frozen=True)
class Changed:
    """A changed report, and what was changed in words."""

    report: bytes
    detail: str


def perturb(kind: PerturbationKind, report: bytes, scene: PerturbedScene) -> Changed | None:
    """Return the changed report; None where the perturbation does not apply or changes nothing.

    ``report`` is another crash's for a kind that needs one. Raises :class:`~trace_dag.common.errors.Rejection` for data
    that is not a report.

    >>> changed = perturb(KINDS["clock_3h"], report_xml, perturbed_scene)
    >>> changed.detail, b'"IMPACT1": "6"' in changed.report
    ('areas of vehicle 1 turned by 3 h', True)
    """
    if begins_with(scene.record) not in kind.of:
        return None
    changed = ChangedReport(report)
    before = changed.to_bytes()
    detail = kind.change(changed, scene)
    after = changed.to_bytes()
    if detail is None or (after == before and kind is not NOTHING):
        return None
    return Changed(after, detail)


def _nothing(_report: ChangedReport, _scene: PerturbedScene) -> str:
    """Return the report as it is: the control of the controls."""
    return "nothing"


NOTHING: Final = PerturbationKind("nothing", "nothing", _nothing, of=PERTURBED)
_STRAIGHT: Final = (PreCrashMovement.GOING_STRAIGHT, PreCrashMovement.NEGOTIATING_CURVE)


def _clocks() -> Iterator[PerturbationKind]:
    turn = vehicles.turn_clocks
    for hours in (1, 2, 3, 4, 6):
        yield PerturbationKind(
            f"clock_{hours}h", f"clock of vehicle 1 by {hours} h", partial(turn, hours=hours, both=False), of=PERTURBED
        )
    for hours in (3, 4, 6):
        yield PerturbationKind(
            f"clocks_{hours}h", f"clocks of both by {hours} h", partial(turn, hours=hours, both=True)
        )
    yield PerturbationKind("clocks_swapped", "clocks swapped", vehicles.swap_clocks)
    yield PerturbationKind("clocks_mirrored", "clocks mirrored", vehicles.mirror_clocks)
    yield PerturbationKind("clocks_random", "clocks random", vehicles.random_clocks, drawn=True)


def _movements() -> Iterator[PerturbationKind]:
    left, right = PreCrashMovement.TURNING_LEFT, PreCrashMovement.TURNING_RIGHT
    for name, title, to in (
        ("left_for_right", "left for right", {left: right, right: left}),
        ("straight_for_left", "straight for left", dict.fromkeys((left, right), PreCrashMovement.GOING_STRAIGHT)),
        ("left_for_straight", "left for straight", dict.fromkeys(_STRAIGHT, left)),
        ("both_u_turn", "both U-turn", dict.fromkeys(PreCrashMovement, PreCrashMovement.U_TURN)),
        ("both_backing", "both backing", dict.fromkeys(PreCrashMovement, PreCrashMovement.BACKING)),
    ):
        yield PerturbationKind(name, title, partial(vehicles.change_movements, to=to), of=PERTURBED)


def _speeds() -> Iterator[PerturbationKind]:
    yield PerturbationKind("speeds_swapped", "speeds swapped", vehicles.swap_speeds)
    for mph in (0, 1, 150):
        change = partial(vehicles.set_speeds, mph=mph)
        yield PerturbationKind(f"speeds_{mph}", f"speeds {mph} mph", change, of=PERTURBED)


def _places() -> Iterator[PerturbationKind]:
    for far_m in (10, 30, 100, 300, 1000):
        for way, east, north in (("n", 0, 1), ("e", 1, 0), ("s", 0, -1), ("w", -1, 0)):
            change = partial(crash.move, east_m=far_m * east, north_m=far_m * north)
            title = f"moved {far_m} m {way.upper()}"
            yield PerturbationKind(f"moved_{far_m}m_{way}", title, change, moves=True, of=PERTURBED)


def _crash_types() -> Iterator[PerturbationKind]:
    for name, title, codes in (
        ("single", "single vehicle, both", (1, 1)),
        ("head_on", "head-on", (50, 51)),
        ("left_across", "left across", (68, 69)),
        ("crossing_right", "crossing 86/87", (86, 87)),
        ("crossing_left", "crossing 88/89", (88, 89)),
        ("backing", "backing", (92, 93)),
    ):
        yield PerturbationKind(f"type_{name}", f"crash type: {title}", partial(vehicles.set_crash_types, codes=codes))
    yield PerturbationKind("types_swapped", "crash types swapped", vehicles.swap_crash_types)


def _what_happened() -> Iterator[PerturbationKind]:
    yield PerturbationKind("manner_rear_to_rear", "manner: rear to rear", partial(crash.set_manner, code=10))
    yield PerturbationKind("manner_front_to_front", "manner: front to front", partial(crash.set_manner, code=2))
    yield PerturbationKind("tree_harm", "first harmful event: a tree", crash.tree_as_first_harm)
    yield PerturbationKind("tree_event", "first event: a tree", crash.tree_as_first_event)
    partner_stays = partial(crash.tree_as_first_event, partner_stays=True)
    yield PerturbationKind("tree_event_code", "first event: a tree, code alone", partner_stays)


def _people() -> Iterator[PerturbationKind]:
    for name, title, change in (
        ("person_mirrored", "the person from the other side", people.mirror_sides),
        ("person_along", "the person along the road", people.go_along),
        ("person_on_sidewalk", "the person on a sidewalk", people.on_sidewalk),
        ("strikes_swapped", "strikes of two vehicles swapped", people.swap_strikes),
    ):
        yield PerturbationKind(name, title, change, of=_STRIKES)


def _streets() -> Iterator[PerturbationKind]:
    names = crash.made_up_names
    one, both = partial(names, elements=("TWAY_ID",)), partial(names, elements=("TWAY_ID", "TWAY_ID2"))
    yield PerturbationKind("name_made_up", "street name made up", one, drawn=True, of=PERTURBED)
    yield PerturbationKind("names_made_up", "both street names made up", both, drawn=True, of=PERTURBED)
    yield PerturbationKind("name_i999", "street name I-999", partial(crash.name_street, name="I-999"), of=PERTURBED)
    for name, title, kind, junction in (
        ("none", "none", 1, 1),
        ("four_way", "four-way", 2, 2),
        ("roundabout", "roundabout", 6, 2),
        ("five_arms", "five arms", 7, 2),
    ):
        change = partial(crash.set_intersection, kind=kind, junction=junction)
        yield PerturbationKind(f"intersection_{name}", f"intersection: {title}", change, of=PERTURBED)


def _road() -> Iterator[PerturbationKind]:
    road = crash.set_road
    for name, title, change in (
        ("road_interstate", "class, lanes, limit: interstate", partial(road, interstate=True, lanes=6, limit_mph=70)),
        ("class_interstate", "class of an interstate", partial(road, interstate=True)),
        ("lanes_6", "six lanes", partial(road, lanes=6)),
        ("lanes_1", "one lane", partial(road, lanes=1)),
        ("limit_70", "limit 70 mph", partial(road, limit_mph=70)),
        ("alignment_mirrored", "alignment mirrored", crash.mirror_alignment),
        ("alignment_other", "curved for straight, straight for curved", crash.other_alignment),
    ):
        yield PerturbationKind(name, title, change, of=PERTURBED)


def _whole_reports() -> Iterator[PerturbationKind]:
    yield PerturbationKind("bodies", "bodies: bus and motorcycle", partial(vehicles.set_bodies, codes=(52, 80)))
    yield PerturbationKind("vehicles_random", "all about the vehicles random", vehicles.random_vehicles, drawn=True)
    yield PerturbationKind("blank", "blank but for the place", crash.blank)
    yield PerturbationKind("blank_head_on", "blank but for place, head-on types", partial(crash.blank, head_on=True))
    named = partial(crash.blank, head_on=True, named=True)
    yield PerturbationKind("blank_head_on_named", "blank but for place, names, head-on types", named)


def _elsewhere() -> Iterator[PerturbationKind]:
    other = Needs.OTHER_REPORT
    own, here = partial(crash.set_down, named_here=False), partial(crash.set_down, named_here=True)
    yield PerturbationKind("foreign_site", "foreign site", own, other, drawn=True, of=PERTURBED)
    named = "foreign site, names of this site"
    yield PerturbationKind("foreign_site_named_here", named, here, other, drawn=True, of=PERTURBED)
    for name, title, needs in (
        ("random_point_other_street", "random point, another street", Needs.OTHER_STREET),
        ("random_point_same_street", "random point, same street", Needs.SAME_STREET),
    ):
        yield PerturbationKind(name, title, crash.at_point, needs, drawn=True, moves=True, of=PERTURBED)


KINDS: Final[dict[str, PerturbationKind]] = {
    kind.name: kind
    for kinds in (
        *([NOTHING], _clocks(), _movements(), _speeds(), _places(), _crash_types(), _what_happened()),
        *(_people(), _streets(), _road(), _whole_reports(), _elsewhere()),
    )
    for kind in kinds
}
"""Every perturbation by its name, in the order of the table."""
