"""Stored crashes as scenario packages.

Belongs here: the choice of stored artefacts for a package or an exported scenario. Does not belong here: the files
themselves (:mod:`trace_dag.scenario`), and the choice of crashes (:mod:`trace_dag.export.build`,
:mod:`trace_dag.export.export`).
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from trace_dag.agents.stored_variations import AboutVariation
from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.stage import Stage
from trace_dag.flow.artefacts import (
    ESTIMATE,
    EXTRACT,
    LOGS,
    MAP_REPORT,
    RECORD,
    ROAD_MAP,
    SAMPLED,
    VERDICT,
    XODR,
    report_file,
    surroundings_of,
)
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.records import Records

if TYPE_CHECKING:
    from trace_dag.agents.stored_cases import StoredCase
    from trace_dag.agents.stored_traffic import StoredTraffic
    from trace_dag.pages.replay_content import ReplayContent


def package_of(
    files: CrashFiles, replay: ReplayContent | None = None, *, traffic: StoredTraffic | None = None
) -> dict[str, bytes]:
    """Return the scenario package of a verified crash, by file name.

    ``replay`` is the content of its replay, if already made; ``traffic`` is the traffic made for its present verdict.
    """
    from trace_dag.agents.stored_cases import case_of
    from trace_dag.export.package import PackageInput, package_files
    from trace_dag.osm.xml import write_osm
    from trace_dag.scenario.drives import drives_of

    verdict, picture = files.load(VERDICT), files.picture("png")
    return package_files(
        PackageInput(
            record=files.load(RECORD),
            report=report_file(files),
            osm_xml=write_osm(files.load(EXTRACT)),
            map_xodr=files.load(XODR),
            provenance={
                stage.value: {
                    "code": record.provenance.code,
                    "settings": record.provenance.settings,
                    "inputs": record.provenance.inputs,
                    "fingerprint": record.fingerprint,
                }
                for stage, record in files.records.items()
            },
            network=files.load(ROAD_MAP),
            map_report=files.load(MAP_REPORT),
            estimate=files.load(ESTIMATE),
            log=files.load(LOGS)[verdict.hypothesis],
            verdict=verdict,
            drives=drives_of(case_of(files, files.settings.sim)),
            surroundings=surroundings_of(files),
            picture=files.storage.read_whole(picture) if picture else None,
            replay=replay,
            traffic=traffic,
            sampled=files.load(SAMPLED) if files.has(SAMPLED) else None,
        )
    )


def package_of_variation(stored: StoredCase) -> dict[str, bytes]:
    """Return the scenario package of a variation, by file name, with a verdict against the report."""
    from trace_dag.agents.stored_cases import load_case
    from trace_dag.agents.stored_variations import read_variation
    from trace_dag.export.package import PackageInput, package_files
    from trace_dag.osm.xml import write_osm
    from trace_dag.scenario.drives import drives_of
    from trace_dag.verdict.judge import judge

    if stored.variation is None:
        raise ValueError(f"{stored.key} is not a variation")
    files = stored.files.unread()
    varied = read_variation(files.storage, stored.variation)
    record, network, map_report = files.load(RECORD), files.load(ROAD_MAP), files.load(MAP_REPORT)
    about: dict[str, Any] = json_adapter(AboutVariation).dump_python(varied.about, mode="json")
    verdict = judge(record, network, map_report, varied.estimate, [varied.log], files.settings.verdict)
    return package_files(
        PackageInput(
            record=record,
            report=report_file(files),
            osm_xml=write_osm(files.load(EXTRACT)),
            map_xodr=files.load(XODR),
            provenance={"variation": {"code": varied.about.code_version, "request": asdict(varied.about.request)}},
            network=network,
            map_report=map_report,
            estimate=varied.estimate,
            log=varied.log,
            verdict=verdict,
            drives=drives_of(load_case(stored)),
            variation=about,
        )
    )


def map_attribution(records: Records) -> str:
    """Return the required attribution of a crash's map; empty without a map."""
    record = records.get(Stage.OSM_EXTRACT)
    return str(record.figures.get("attribution") or "") if record else ""
