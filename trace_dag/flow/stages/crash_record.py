"""Stage ``crash_record``: the report as a typed record, if it is complete."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.common.errors import Rejection
from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report
from trace_dag.crash.tables import record_to_parquet
from trace_dag.flow.contract import Figure, StageProduct

if TYPE_CHECKING:
    from trace_dag.common.settings import CrashSettings


def crash_record(
    key: str, report_xml: bytes | None, report_json: bytes | None, settings: CrashSettings
) -> StageProduct:
    """Return the report as a typed record; reject an incomplete one, but keep it."""
    name, data = (f"{key}.xml", report_xml) if report_xml is not None else (f"{key}.json", report_json)
    assert data is not None
    # Named after the key: a copy of a report gives the same result.
    record = read_report(data, name=name, settings=settings, expected_key=key)
    rejection = None
    try:
        check(record, settings)
    except Rejection as shortcoming:
        rejection = shortcoming
    figures: dict[str, Figure] = {
        "summary": record.summary,
        "kind": record.kind.value,
        "vehicles": len(record.vehicles),
        "collision_type": record.collision_type.value,
        "road_topology": record.road_topology.value,
        "vehicle_trajectory": record.vehicle_trajectory.value,
        "latitude_deg": record.latitude_deg,
        "longitude_deg": record.longitude_deg,
        "contradictions": "; ".join(record.contradictions),
        "areas_of_impact": "impact" not in record.register_lacks,
    }
    return StageProduct({"parquet": record_to_parquet(record)}, figures, rejection)
