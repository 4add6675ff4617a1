"""Exporters: what turns verified crashes into the files of one form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from trace_dag.flow.contract import CrashFiles


class Exporter(Protocol):
    """Writes crashes in one form (entry points of the group ``trace_dag.exporters``, usually a class)."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Prepare for the crashes ``keys``."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """Return the files of one verified crash, by path below the folder of the export.

        Raises :class:`trace_dag.common.errors.UserError` for a crash that the form cannot express; it is left out and
        named.
        """
        ...

    def beside(self) -> Mapping[str, bytes]:
        """Return the files about all crashes, after every crash has been written; none where each explains itself."""
        return {}
