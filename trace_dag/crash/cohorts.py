"""Choosing crashes: filters, a reproducible random sample, and one that fills the coverage classes.

Pure functions over listings; cohorts are named, stored and extended in :mod:`trace_dag.flow.cohorts`. A sample depends
on the seed and the crashes alone, not on the order in which a source lists them, and the first 50 of a sample of 100
are the sample of 50.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Final, TypeAlias

from trace_dag.common.errors import UserError
from trace_dag.crash.classes import CollisionType, CrashKind, RoadTopology, VehicleTrajectory

if TYPE_CHECKING:
    from trace_dag.crash.listing import CrashListing

COVERAGE_DIMENSIONS: Final = ("collision_type", "road_topology", "vehicle_trajectory")
"""The three dimensions of the published coverage table, as fields of a listing."""
Box: TypeAlias = tuple[float, float, float, float]
"""South, west, north, east in degrees (WGS84)."""


@dataclass(frozen=True)
class CohortFilter:
    """Conditions for choosing a crash; an empty field takes everything.

    A field leaves out a crash whose source lacks the value. ``counties`` and ``cities`` are FARS codes or parts of
    names, in any case.
    """

    kinds: frozenset[CrashKind] = frozenset()
    states: frozenset[int] = frozenset()
    years: frozenset[int] = frozenset()
    counties: frozenset[str] = frozenset()
    cities: frozenset[str] = frozenset()
    box: Box | None = None
    function_classes: frozenset[int] = frozenset()
    collision_types: frozenset[CollisionType] = frozenset()
    topologies: frozenset[RoadTopology] = frozenset()
    trajectories: frozenset[VehicleTrajectory] = frozenset()
    min_vehicles: int | None = None
    max_vehicles: int | None = None

    def __post_init__(self) -> None:
        if self.box is not None and not (
            -90 <= self.box[0] <= self.box[2] <= 90 and -180 <= self.box[1] <= self.box[3] <= 180
        ):
            raise UserError(f"bounding box {self.box}: expected south, west, north, east in degrees, in that order")
        low, high = self.min_vehicles, self.max_vehicles
        if low is not None and high is not None and low > high:
            raise UserError(f"at least {low} and at most {high} vehicles: no crash can have both")

    def admits(self, crash: CrashListing) -> bool:
        """Return whether the crash satisfies all fields of the filter."""
        return (
            _one_of(crash.kind, self.kinds)
            and _one_of(crash.state_code, self.states)
            and _one_of(crash.case_year, self.years)
            and _place(crash.county_code, crash.county_name, self.counties)
            and _place(crash.city_code, crash.city_name, self.cities)
            and self._in_box(crash)
            and _one_of(crash.function_class_code, self.function_classes)
            and _one_of(crash.collision_type, self.collision_types)
            and _one_of(crash.road_topology, self.topologies)
            and _one_of(crash.vehicle_trajectory, self.trajectories)
            and (self.min_vehicles is None or (crash.vehicles is not None and crash.vehicles >= self.min_vehicles))
            and (self.max_vehicles is None or (crash.vehicles is not None and crash.vehicles <= self.max_vehicles))
        )

    def _in_box(self, crash: CrashListing) -> bool:
        if self.box is None:
            return True
        if crash.latitude_deg is None or crash.longitude_deg is None:
            return False
        south, west, north, east = self.box
        return south <= crash.latitude_deg <= north and west <= crash.longitude_deg <= east


def select(crashes: Iterable[CrashListing], wanted: CohortFilter) -> list[CrashListing]:
    """Return the crashes the filter admits, in order of their keys.

    >>> from trace_dag.crash.listing import list_report
    >>> listed = list_report(report_xml, name="crash_319003.xml")
    >>> [each.key for each in select([listed], CohortFilter(states=frozenset({31})))]  # Nebraska
    ['2023-319003']
    """
    return sorted((crash for crash in crashes if wanted.admits(crash)), key=lambda crash: crash.key)


def sample(crashes: Iterable[CrashListing], size: int, *, seed: int) -> list[CrashListing]:
    """Return a random sample without replacement, in order of choice; all crashes if there are no more than ``size``.

    >>> from dataclasses import replace
    >>> from trace_dag.crash.listing import list_report
    >>> listed = list_report(report_xml, name="crash_319003.xml")
    >>> len(sample([replace(listed, key=f"2023-{case}") for case in range(310001, 310100)], 5, seed=1))
    5
    """
    _check_size(size)
    return _shuffled(crashes, seed)[:size]


def stratified_sample(crashes: Iterable[CrashListing], size: int, *, seed: int) -> list[CrashListing]:
    """Return a sample that fills the classes of the three coverage dimensions as evenly as the crashes allow.

    Greedy: every next crash is the one whose three classes have been chosen least so far (the sum over the
    dimensions of 1 / (1 + chosen) is largest), ties broken at random by the seed. The first crashes thus cover
    every class that occurs, and rare classes are used up before frequent ones repeat.
    """
    _check_size(size)
    classes_of = attrgetter(*COVERAGE_DIMENSIONS)
    cells: dict[tuple[object, ...], list[CrashListing]] = {}
    for crash in reversed(_shuffled(crashes, seed)):
        cells.setdefault(classes_of(crash), []).append(crash)  # popped from the end, so first of the shuffle first
    order = {cell: _rank(seed, repr(cell)) for cell in cells}
    counts: list[Counter[object]] = [Counter() for _ in COVERAGE_DIMENSIONS]
    chosen: list[CrashListing] = []
    while cells and len(chosen) < size:
        best = max(
            cells,
            key=lambda cell: (
                sum(1 / (1 + count[each]) for count, each in zip(counts, cell, strict=True)),
                order[cell],
            ),
        )
        chosen.append(cells[best].pop())
        if not cells[best]:
            del cells[best]
        for count, each in zip(counts, best, strict=True):
            count[each] += 1
    return chosen


def _shuffled(crashes: Iterable[CrashListing], seed: int) -> list[CrashListing]:
    unique = {crash.key: crash for crash in crashes}
    return sorted(unique.values(), key=lambda crash: _rank(seed, crash.key))


def _rank(seed: int, text: str) -> bytes:
    return hashlib.sha256(f"{seed}:{text}".encode()).digest()


def _check_size(size: int) -> None:
    if size < 1:
        raise UserError(f"a sample of {size} crashes; expected 1 or more")


def _one_of(value: object, wanted: Collection[object]) -> bool:
    return not wanted or value in wanted


def _place(code: int | None, name: str, wanted: frozenset[str]) -> bool:
    if not wanted:
        return True
    return any(
        (code is not None and entry == str(code)) or (not entry.isdigit() and entry.casefold() in name.casefold())
        for entry in wanted
    )
