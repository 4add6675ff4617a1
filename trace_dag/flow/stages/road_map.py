"""Stage ``road_map``: the OpenDRIVE road map around a crash."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.flow.contract import Figure, StageProduct
from trace_dag.roads.build import RejectedRoadMap, build_road_map

if TYPE_CHECKING:
    from trace_dag.common.settings import RoadSettings
    from trace_dag.crash.record import CrashRecord
    from trace_dag.osm.types import OsmExtract


def road_map(record: CrashRecord, extract: OsmExtract, settings: RoadSettings) -> StageProduct:
    """Return the OpenDRIVE road map, with the crash's place, its gates and its agreement with the report.

    If the map leads to a rejection it is kept under other names, for inspection only.
    """
    try:
        built = build_road_map(extract, record, settings)
    except RejectedRoadMap as rejected:
        kept = {"rejected.xodr": rejected.xodr, "rejected.json": rejected.report.to_json()}
        read_back = {"rejected.xodr": rejected.network, "rejected.json": rejected.report}
        return StageProduct(kept, {"converter": rejected.report.converter}, rejected, parsed=read_back)
    report = built.report
    figures: dict[str, Figure] = {
        "roads": report.roads,
        "junctions": report.junctions,
        "converter": report.converter,
        "moved_m": report.placement.moved_m,
        "matched_by": report.placement.matched_by,
        "gates_passed": sum(gate.passed is True for gate in report.gates),
        "gates_failed": sum(gate.passed is False for gate in report.gates),
        "things_beside_road": len(report.things),
        "attributes_that_differ": sum(each.agreement == "differs" for each in report.comparisons),
    }
    files = {"xodr": built.stored.xodr, "json": report.to_json()}
    return StageProduct(files, figures, parsed={"xodr": built.stored.network})
