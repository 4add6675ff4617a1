"""Exporters, and the course of a crash without the crash, which most forms need."""

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

        Raises :class:`trace_dag.common.errors.UserError` for a crash that the form has no words for: it is left out and
        named.
        """

    def beside(self) -> Mapping[str, bytes]:
        """Return the files about all of them, asked for when every crash has been written."""


def as_driven(crash: CrashFiles) -> Case:
    """Return a verified crash with everybody's course as it would have gone on: what agents are evaluated in."""
    return case_of(crash, crash.settings.sim)
