"""Return a verified crash as agents are evaluated in it, with all courses as they would have continued."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from trace_dag.agents.replays import replay
from trace_dag.flow.contract import CrashFiles


class Glb:
    """``<key>.glb`` of each crash: the road, all parties, and their motion on the log's clock."""

    def __init__(self, keys: Sequence[str]) -> None:
        """Ignore the keys, which this format does not need."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        """See :class:`trace_dag.export.formats.exporter.Exporter`."""
        return {f"{crash.key}.glb": replay(crash, "glb")}

    def beside(self) -> Mapping[str, bytes]:
        """Return no files, since each file explains itself."""
        return {}
