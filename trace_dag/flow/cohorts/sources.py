"""Sources of crashes, each as offers to choose from and reports to register: folders, FARS CSV, the CrashAPI.

Belongs here: the crashes that each source offers under a choice, and the location of a chosen crash's report for the
first stage. Does not belong here: reading reports (:mod:`trace_dag.crash`) and storing cohorts (the registry).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from trace_dag.common.errors import Rejection, UserError
from trace_dag.common.messages.progress import OnProgress
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.storage.files import Storage
from trace_dag.crash.folder import FoundReport
from trace_dag.crash.keys import fars_case
from trace_dag.crash.listing import CrashListing, list_report
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.kept_files import FOLDER, keep_reports
from trace_dag.flow.cohorts.registry import ReportSource

if TYPE_CHECKING:
    from trace_dag.crash.fars.crashapi import CrashApiClient


class Source(Protocol):
    """A source of crashes."""

    @property
    def name(self) -> str:
        """Return the cohort's note on the origin of its crashes."""
        ...

    def offers(self, choice: Choice) -> list[CrashListing]:
        """Return the crashes that the choice admits, before sampling, with the facts it needs.

        Raises UserError for a source that cannot be read.
        """
        ...

    def take(
        self, storage: Storage, keys: Collection[str], known: Mapping[str, ReportSource]
    ) -> dict[str, ReportSource]:
        """Return the locations of the reports of some offered crashes; ``known`` are those already registered."""
        ...


@dataclass(frozen=True)
class FolderSource:
    """Reports found in folders."""

    found: Sequence[FoundReport]
    name: str = "reports"

    def offers(self, choice: Choice) -> list[CrashListing]:
        """See :class:`Source`. A report that cannot be read offers its key alone."""
        if choice.takes_all:
            return [_bare(report.key) for report in self.found]
        return choice.admitted(_listed(report.key, report.path.read_bytes()) for report in self.found)

    def take(
        self, storage: Storage, keys: Collection[str], known: Mapping[str, ReportSource]
    ) -> dict[str, ReportSource]:
        """See :class:`Source`. Files stay where they lie; an object store takes copies."""
        taken = {}
        for report in self.found:
            if report.key not in keys:
                continue
            if storage.local_root is not None:
                taken[report.key] = ReportSource("file", str(report.path.absolute()), report.sha256)
            else:
                stored = storage.write(f"{FOLDER}/{report.key}.xml", report.path.read_bytes())
                taken[report.key] = ReportSource("stored", stored.name, report.sha256)
        return taken


class ReportTables(Protocol):
    """A package's source of reports, opened at a location.

    It is an entry point of the group ``trace_dag.report_sources``, a class with ``open(location)``.
    """

    def notes(self) -> Sequence[str]:
        """Return sentences on the present and missing files.

        Raises UserError if nothing can be done without the missing ones.
        """
        ...

    def listings(self) -> Iterable[CrashListing]:
        """Return one line per crash."""
        ...

    def reports(self, keys: Collection[str]) -> Iterable[tuple[str, bytes]]:
        """Return key and report of the crashes asked for, as :func:`trace_dag.crash.parse.read_report` reads them."""
        ...


class TableSource:
    """A source that reads whole tables.

    It is a register with a mapping, or a source of an installed package, such as ``fars-csv``, the national CSV files.
    """

    def __init__(self, name: str, tables: ReportTables) -> None:
        self.name = name
        self._tables = tables
        self.notes: tuple[str, ...] = ()  # known once the crashes are offered

    @classmethod
    def of_plugin(cls, plugin: str, location: str) -> TableSource:
        """Return the source that a package offers under a name, opened at a location."""
        return cls(f"{plugin} {Path(location).name}", load(PluginKind.REPORT_SOURCE, plugin).open(location))

    def offers(self, choice: Choice) -> list[CrashListing]:
        offered = choice.admitted(self._tables.listings())
        self.notes = tuple(self._tables.notes())  # after them, so that a large table is read once for both
        return offered

    def take(
        self, storage: Storage, keys: Collection[str], known: Mapping[str, ReportSource]
    ) -> dict[str, ReportSource]:
        """See :class:`Source`. Each report is kept below the root."""
        return keep_reports(storage, self._tables.reports(keys), known)


@dataclass(frozen=True)
class CrashApiSource:
    """The CrashAPI. Facts missing in a list of cases come from the reports, which stay in the cache."""

    client: CrashApiClient
    progress: OnProgress | None = None
    case_lists: CrashApiClient | None = None
    name: str = "CrashAPI"

    def offers(self, choice: Choice) -> list[CrashListing]:
        """See :class:`Source`. Raises TransientFailure or Failure where the service does not answer."""
        wanted = choice.wanted
        if choice.cases:
            cases = [_bare(key) for key in choice.cases]
        elif wanted.states and wanted.years:
            low, high = wanted.min_vehicles, wanted.max_vehicles
            cases = (self.case_lists or self.client).list_cases(
                wanted.states,
                wanted.years,
                min_vehicles=1 if low is None else low,
                max_vehicles=99 if high is None else high,
            )
        else:
            raise UserError("CrashAPI: say which cases to ask for, by states and years or by their keys")
        if not choice.reads_reports:
            # The service has counted the vehicles; its list does not repeat the numbers.
            counted = replace(wanted, min_vehicles=None, max_vehicles=None)
            return replace(choice, wanted=counted).admitted(cases)
        return choice.admitted(self._looked_up(cases))

    def take(
        self, storage: Storage, keys: Collection[str], known: Mapping[str, ReportSource]
    ) -> dict[str, ReportSource]:
        """See :class:`Source`: the service is asked when the crash is run."""
        return {key: ReportSource("crashapi") for key in keys}

    def _looked_up(self, cases: Sequence[CrashListing]) -> Iterable[CrashListing]:
        for done, case in enumerate(cases):
            if self.progress is not None:
                self.progress(done, len(cases))
            yield _listed(case.key, self.client.report(case.key))
        if self.progress is not None:
            self.progress(len(cases), len(cases))


def _bare(key: str) -> CrashListing:
    return CrashListing(key, *fars_case(key))


def _listed(key: str, data: bytes) -> CrashListing:
    try:
        return list_report(data, name=key)
    except Rejection:
        return _bare(key)
