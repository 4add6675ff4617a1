"""Groups of crashes for cutting their maps together."""

from __future__ import annotations

from collections.abc import Sequence

from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.registry import RegisteredMap
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.stages.osm_extract import catalog_of


def by_map_files(crashes: Sequence[CrashFiles]) -> list[list[str]]:
    """Return groups of crashes in the same map files, so that each file is read once; small groups are joined.

    Crashes outside all map files fill up the groups.
    """
    most = crashes[0].settings.execution.chunk_size
    groups: dict[tuple[tuple[RegisteredMap, ...], tuple[int, ...]], list[str]] = {}
    for crash in crashes:
        figures = crash.figures(Stage.CRASH_RECORD)
        latitude_deg, longitude_deg = float(figures["latitude_deg"] or 0), float(figures["longitude_deg"] or 0)
        boxes = [file.header.box for file in catalog_of(crash.source.maps, crash.services).files]
        covering = tuple(
            index for index, box in enumerate(boxes) if box is None or box.contains(latitude_deg, longitude_deg)
        )
        groups.setdefault((crash.source.maps, covering), []).append(crash.key)
    alone = [keys for (_, covering), keys in groups.items() if not covering]
    shared = [keys for (_, covering), keys in groups.items() if covering]
    pieces = [keys[start : start + most] for keys in alone for start in range(0, len(keys), most)]
    joined: list[list[str]] = []
    for group in sorted([*shared, *pieces], key=len, reverse=True):
        if joined and len(joined[-1]) + len(group) <= most:
            joined[-1].extend(group)
        else:
            joined.append(group)
    return joined
