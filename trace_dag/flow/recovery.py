"""Registration of crashes whose cohorts are lost, from their stored records."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import count, filterfalse
from pathlib import PurePosixPath

from trace_dag.common.messages.logs import print_problem
from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.artefacts import REPORT_JSON, REPORT_XML
from trace_dag.flow.cohorts.registry import Registry, ReportSource
from trace_dag.flow.records import read_records

COHORT = "recovered"


def register_again(storage: Storage, lost: Iterable[str]) -> None:
    """Delete lost cohorts, and register their crashes in new ones called ``recovered``.

    These are all crashes with a record of a report that are in no cohort.

    The report is the one that the first stage kept, or is requested from the service again. Only a digest of the maps
    is known, so the results stay as they are; crashes that still need a map fail until maps are registered again.
    """
    left_out, registry = [], Registry(storage)
    for cohort in lost:
        registry.forget(cohort)
    keys = {crash_of(name) for name in storage.list(Stage.RAW_REPORT.value)} - set(registry.keys())
    by_maps: dict[str, dict[str, ReportSource]] = {}
    for key, records in read_records(storage, sorted(keys)).items():
        record, extract = records.get(Stage.RAW_REPORT), records.get(Stage.OSM_EXTRACT)
        if record is None:
            left_out.append(key)
            continue
        source = ReportSource("crashapi")
        if record.figures.get("source") != "crashapi":
            extensions = (*REPORT_XML.extensions, *REPORT_JSON.extensions)
            kept = next((file for each in extensions if (file := record.artefact(each)) is not None), None)
            if kept is None:
                left_out.append(key)
                continue
            source = ReportSource("stored", f"reports/{PurePosixPath(kept.name).name}", kept.sha256)
            if not storage.exists(source.location):
                storage.write(source.location, storage.read_whole(kept))
        maps = extract.provenance.inputs.get("maps", "") if extract is not None else ""
        by_maps.setdefault(maps, {})[key] = source
    unknown = by_maps.pop("", {})
    first = min(by_maps, default="")
    by_maps[first] = by_maps.get(first, {}) | unknown
    names = (COHORT if number == 1 else f"{COHORT}-{number}" for number in count(1))
    free = filterfalse(registry.cohorts().__contains__, names)
    for name, (maps, reports) in zip(free, sorted(each for each in by_maps.items() if each[1]), strict=False):
        registry.register(name, reports, origin="records of a lost registry", lost_maps=maps or None)
    if left_out:
        print_problem(
            f"not registered again, since nothing is kept of the report: {', '.join(left_out)}; ingest it again"
        )
