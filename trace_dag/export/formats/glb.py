"""Crashes in three dimensions as glTF 2.0, for Blender and viewers: ``trace-dag export --format glb``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from trace_dag.agents.replays import replay
from trace_dag.flow.contract import CrashFiles


class Glb:
    """``<key>.glb`` of each crash: the road, everybody in it, and their motion on the log's clock."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Prepare nothing."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.export.formats.exporter.Exporter`."""
        return {f"{crash.key}.glb": replay(crash, "glb")}

    def beside(self) -> Mapping[str, bytes]:
        """Return nothing: each file explains itself."""
        return {}
