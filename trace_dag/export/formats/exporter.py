"""Exporters, and the motion of all parties without the crash, which most forms need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from trace_dag.agents.stored_cases import case_of
from trace_dag.flow.contract import CrashFiles
from trace_dag.scenario.cases import Case


class Exporter(Protocol):
    """Writes crashes in one form (entry points of the group ``trace_dag.exporters``, usually a class)."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Prepare for the crashes ``keys``."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """Return the files of one verified crash, by path below the folder of the export.

        Raises :class:`trace_dag.common.errors.UserError` for a crash that the form cannot express; it is left out and
        named.
        """

    def beside(self) -> Mapping[str, bytes]:
        """Return the files about all crashes, after every crash has been written."""


def as_driven(crash: CrashFiles) -> Case:
    """Return a verified crash with the course of each party as if it had not happened, for evaluations."""
    return case_of(crash, crash.settings.sim)
