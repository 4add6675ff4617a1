"""The options that say which of the crashes a source offers are registered."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import TYPE_CHECKING, Any, TypeVar

import click

from trace_dag.common.errors import UserError
from trace_dag.crash.classes import CollisionType, CrashKind, RoadTopology, VehicleTrajectory

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.choice import Choice

F = TypeVar("F", bound=Callable[..., Any])


def _classes(name: str, classes: type[StrEnum], help: str) -> Callable[[F], F]:
    return click.option(
        name,
        multiple=True,
        type=click.Choice([each.value for each in classes]),
        metavar="CLASS",
        help=f"{help}: {', '.join(classes)}.",
    )


_OPTIONS = (
    click.option("--cases", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179."),
    _classes("--kinds", CrashKind, "Only these kinds of crash"),
    click.option("--states", multiple=True, metavar="STATE", help="Only these states: VA, Virginia or 51."),
    click.option("--years", multiple=True, metavar="YEAR", help="Only these case years: 2023, or 2019-2023."),
    click.option("--counties", multiple=True, metavar="COUNTY", help="Only these counties: part of a name, or a code."),
    click.option("--cities", multiple=True, metavar="CITY", help="Only these cities: part of a name, or a code."),
    click.option("--box", nargs=4, type=float, metavar="S W N E", help="Only within these latitudes and longitudes."),
    click.option(
        "--road-classes",
        multiple=True,
        metavar="CLASS",
        help='Only roads of these classes: "interstate", "local road", ..., or FUNC_SYS codes.',
    ),
    _classes("--collision-types", CollisionType, "Only these manners of collision"),
    _classes("--topologies", RoadTopology, "Only these kinds of intersection"),
    _classes("--trajectories", VehicleTrajectory, "Only these courses of the vehicles"),
    click.option("--vehicles", metavar="N", help="Only crashes of so many motor vehicles: 2, 2-3 or 2-."),
    click.option("--sample", type=click.IntRange(min=1), metavar="N", help="A random sample of the crashes left."),
    click.option(
        "--stratified",
        type=click.IntRange(min=1),
        metavar="N",
        help="A sample that fills the classes of the coverage table as evenly as the crashes left allow.",
    ),
    click.option(
        "--seed",
        default=1,
        show_default=True,
        help="Seed of the sample. The same crashes and seed give the same sample, a larger one begins with it.",
    ),
)


def choice_options(command: F) -> F:
    """Add the options of a choice to a command; :func:`choice_of` reads their values."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def choice_of(options: dict[str, Any]) -> Choice:
    """Return the choice that the options make.

    Raises UserError for an invalid value.
    """
    from trace_dag.crash.cohorts import CohortFilter
    from trace_dag.crash.reported_place import state_code
    from trace_dag.flow.cohorts.choice import Choice

    low, high = _range(options["vehicles"]) if options["vehicles"] else (None, None)
    return Choice(
        CohortFilter(
            kinds=frozenset(map(CrashKind, options["kinds"])),
            states=frozenset(map(state_code, options["states"])),
            years=frozenset(_years(options["years"])),
            counties=frozenset(options["counties"]),
            cities=frozenset(options["cities"]),
            box=options["box"] or None,
            function_classes=frozenset(map(_road_class, options["road_classes"])),
            collision_types=frozenset(map(CollisionType, options["collision_types"])),
            topologies=frozenset(map(RoadTopology, options["topologies"])),
            trajectories=frozenset(map(VehicleTrajectory, options["trajectories"])),
            min_vehicles=low,
            max_vehicles=high,
        ),
        frozenset(options["cases"]),
        options["sample"],
        options["stratified"],
        options["seed"],
    )


def _years(texts: Iterable[str]) -> set[int]:
    years: set[int] = set()
    for text in texts:
        match = re.fullmatch(r"([12][0-9]{3})(?:-([12][0-9]{3}))?", text)
        if match is None or int(match[2] or match[1]) < int(match[1]):
            raise UserError(f"--years {text}: expected a case year such as 2023, or a range such as 2019-2023")
        years.update(range(int(match[1]), int(match[2] or match[1]) + 1))
    return years


def _range(text: str) -> tuple[int, int | None]:
    match = re.fullmatch(r"([0-9]{1,3})(-)?([0-9]{1,3})?", text)
    if match is None or (match[3] and not match[2]):
        raise UserError(f"--vehicles {text}: expected a number such as 2, or a range such as 2-3 or 2-")
    low = int(match[1])
    return low, (int(match[3]) if match[3] else None if match[2] else low)


def _road_class(text: str) -> int:
    from trace_dag.crash.codes.elements import FUNC_SYS

    named = {meaning: code for code, meaning in FUNC_SYS.meanings.items() if FUNC_SYS.known(code) is not None}
    wanted = " ".join(text.replace("-", " ").replace("_", " ").split()).casefold()
    if wanted.isascii() and wanted.isdigit() and int(wanted) in named.values():
        return int(wanted)
    if wanted not in named:
        raise UserError(f"--road-classes {text}: expected {', '.join(named)}, or a FUNC_SYS code")
    return named[wanted]
