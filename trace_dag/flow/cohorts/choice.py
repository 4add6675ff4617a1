"""The choice of crashes to register among those that the sources offer: a filter, certain cases, a sample.

The rules of choosing are in :mod:`trace_dag.crash.cohorts`; this module combines them and describes the choice in words
for the cohort.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.crash.cohorts import CohortFilter, sample, select, stratified_sample
from trace_dag.crash.keys import parse_key

if TYPE_CHECKING:
    from trace_dag.crash.listing import CrashListing


@dataclass(frozen=True)
class Choice:
    """A filter, then a sample of what it leaves. ``cases``: only these crashes (keys); empty takes any.

    Raises UserError for two kinds of sample at once and for cases that are not keys.
    """

    wanted: CohortFilter = field(default_factory=CohortFilter)
    cases: frozenset[str] = frozenset()
    sample: int | None = None
    stratified: int | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        if self.sample is not None and self.stratified is not None:
            raise UserError("--sample and --stratified at once; choose one of them")
        for key in self.cases:
            parse_key(key)

    @property
    def takes_all(self) -> bool:
        """Return whether every crash is chosen, so that no facts about crashes are needed."""
        return self == Choice(seed=self.seed)

    @property
    def reads_reports(self) -> bool:
        """Return whether choosing needs facts beyond those in a list of cases (state, year, county name, vehicles)."""
        wanted = self.wanted
        return bool(
            self.stratified is not None
            or wanted.kinds
            or wanted.box
            or wanted.cities
            or wanted.function_classes
            or wanted.collision_types
            or wanted.topologies
            or wanted.trajectories
            or any(county.isdigit() for county in wanted.counties)
            or (self.cases and (wanted.counties or wanted.min_vehicles or wanted.max_vehicles))
        )

    def admitted(self, crashes: Iterable[CrashListing]) -> list[CrashListing]:
        """Return the crashes that the filter and the list of cases admit, in order of keys."""
        return select((crash for crash in crashes if not self.cases or crash.key in self.cases), self.wanted)

    def sampled(self, crashes: Iterable[CrashListing]) -> list[CrashListing]:
        """Return the sample of admitted crashes; all of them without a sample."""
        if self.sample is not None:
            return sample(crashes, self.sample, seed=self.seed)
        if self.stratified is not None:
            return stratified_sample(crashes, self.stratified, seed=self.seed)
        return list(crashes)

    def in_words(self) -> str:
        """Return the choice as text for the cohort: ``VA; 2023; 2 vehicles; sample of 100, seed 1``."""
        from trace_dag.crash.codes.elements import FUNC_SYS
        from trace_dag.crash.reported_place import state_abbreviation

        wanted = self.wanted
        groups: list[Iterable[str]] = [
            sorted(wanted.kinds),
            [state_abbreviation(code) for code in sorted(wanted.states)],
            [str(year) for year in sorted(wanted.years)],
            sorted(wanted.counties),
            sorted(wanted.cities),
            [FUNC_SYS.meaning(code) or str(code) for code in sorted(wanted.function_classes)],
            sorted(wanted.collision_types),
            sorted(wanted.topologies),
            sorted(wanted.trajectories),
        ]
        words = [", ".join(group) for group in groups if group]
        if wanted.box is not None:
            south, west, north, east = wanted.box
            words.append(f"latitude {south:g} to {north:g}, longitude {west:g} to {east:g}")
        low, high = wanted.min_vehicles, wanted.max_vehicles
        if low is not None or high is not None:
            several = f"{low if low is not None else 0} to {high}" if high is not None else f"{low} or more"
            words.append(count_of(low, "vehicle") if low is not None and low == high else f"{several} vehicles")
        if self.cases:
            words.append(f"{count_of(len(self.cases), 'case')} by key")
        if self.sample is not None:
            words.append(f"sample of {self.sample}, seed {self.seed}")
        if self.stratified is not None:
            words.append(f"stratified sample of {self.stratified}, seed {self.seed}")
        return "; ".join(words) or "all"
