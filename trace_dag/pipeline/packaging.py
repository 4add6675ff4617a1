"""Stored crashes as scenario packages and in the published layout.

Belongs here: which stored artefacts make up a package or an exported scenario. Does not belong here: what either looks
like (:mod:`trace_dag.scenario`), and which crashes are packed (:mod:`trace_dag.pipeline.benchmark`,
:mod:`trace_dag.pipeline.exporting`).
"""

from __future__ import annotations

from importlib import resources

from trace_dag.errors import Stage
from trace_dag.pipeline import stages
from trace_dag.pipeline.flow import CrashFiles
from trace_dag.pipeline.records import Records


def package_of(files: CrashFiles, records: Records) -> dict[str, bytes]:
    """The scenario package of a verified crash, by file name. ``records`` are those that count."""
    from trace_dag.scenario.package import PackageInput, package_files

    verdict = stages.verdict_of(files)
    return package_files(
        PackageInput(
            record=stages.record_of(files),
            report_xml=files.read(Stage.RAW_REPORT, "xml"),
            osm_xml=files.read(Stage.OSM_EXTRACT, "osm"),
            map_xodr=files.read(Stage.ROAD_MAP, "xodr"),
            provenance={
                stage.value: {
                    "code": record.provenance.code,
                    "settings": record.provenance.settings,
                    "inputs": record.provenance.inputs,
                    "fingerprint": record.fingerprint,
                }
                for stage, record in records.items()
            },
            network=stages.network_of(files),
            map_report=stages.map_report_of(files),
            estimate=stages.estimate_of(files),
            log=stages.logs_of(files)[verdict.hypothesis],
            verdict=verdict,
        )
    )


def unverified_files(files: CrashFiles) -> dict[str, bytes]:
    """What there is to hand out of a crash that was not verified, by the names that a package has for it: the map, the
    verdict and a replay, as far as it got."""
    from trace_dag.scenario.replay import write_html_player

    made = {}
    if files.has(Stage.ROAD_MAP, "xodr"):
        made["map.xodr"] = files.read(Stage.ROAD_MAP, "xodr")
    if files.has(Stage.VERDICT, "json"):
        made["verdict.json"] = files.read(Stage.VERDICT, "json")
    if files.has(Stage.SIMULATION_LOG, "parquet"):
        verdict = stages.verdict_of(files) if files.has(Stage.VERDICT, "json") else None
        log = stages.logs_of(files)[verdict.hypothesis if verdict else 0]
        made["replay.html"] = write_html_player(stages.record_of(files), stages.network_of(files), log, verdict)
    return made


def map_attribution(records: Records) -> str:
    """Whom the map of a crash is to be attributed to; empty where there is no map."""
    record = records.get(Stage.OSM_EXTRACT)
    return str(record.figures.get("attribution") or "") if record else ""


def published_files(files: CrashFiles) -> dict[str, bytes]:
    """A verified crash in the published layout, by path below the benchmark's folder."""
    from trace_dag.scenario.published_layout import write_published

    case = files.key.partition("-")[2]
    hypothesis = stages.verdict_of(files).hypothesis
    simulation = write_published(stages.estimate_of(files).hypotheses[hypothesis], stages.logs_of(files)[hypothesis])
    return {
        f"reports/crash_{case}.xml": files.read(Stage.RAW_REPORT, "xml"),
        f"summary/summary_{case}.txt": (stages.record_of(files).summary + "\n").encode(),
        f"maps/map_{case}.xodr": files.read(Stage.ROAD_MAP, "xodr"),
        f"simulations/simulation_{case}.json": simulation,
    }


def published_readme() -> bytes:
    """What explains the published layout in its folder."""
    return resources.files("trace_dag.scenario").joinpath("templates", "published_readme.md").read_bytes()
