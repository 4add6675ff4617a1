"""Scenario packages as folders, one per key."""

from __future__ import annotations

from collections.abc import Mapping

from trace_dag.agents.stored_traffic import read_traffic
from trace_dag.export.formats.exporter import Exporter
from trace_dag.export.packaging import package_of
from trace_dag.flow.contract import CrashFiles


class Packages(Exporter):
    """A folder per crash with everything about it; see :mod:`trace_dag.export.package`."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        files = package_of(crash, traffic=read_traffic(crash))
        return {f"{crash.key}/{name}": data for name, data in files.items()}
