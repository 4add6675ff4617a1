"""The published benchmark's layout, for scripts written for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from trace_dag.benchmark.packaging import published_files, published_readme
from trace_dag.flow.contract import CrashFiles


class Published:
    """Crashes are known there by their case number alone, which is unique only within a year: those of several years
    lie in a folder per year."""

    def __init__(self, keys: Sequence[str]) -> None:
        self._by_year = len({key.partition("-")[0] for key in keys}) > 1

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.formats.exporter.Exporter`."""
        below = f"{crash.key.partition('-')[0]}/" if self._by_year else ""
        return {below + name: data for name, data in published_files(crash).items()}

    def beside(self) -> Mapping[str, bytes]:
        """What explains the layout."""
        return {"README.md": published_readme()}
