"""Crashes in three dimensions as GLB files, one per key."""

from __future__ import annotations

from collections.abc import Mapping

from trace_dag.agents.replays import replay
from trace_dag.export.formats.exporter import Exporter
from trace_dag.flow.contract import CrashFiles


class Glb(Exporter):
    """``<key>.glb`` of each crash: the road, all parties, and their motion on the log's clock."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        return {f"{crash.key}.glb": replay(crash, "glb")}
