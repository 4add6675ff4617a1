"""What is recorded beside a road map, to and from JSON."""

from __future__ import annotations

from functools import cache

from pydantic import TypeAdapter

from trace_dag.roads.report import MapReport


@cache
def _reports() -> TypeAdapter[MapReport]:
    return TypeAdapter(MapReport)


def map_report_to_json(report: MapReport) -> bytes:
    """The report as stored."""
    return _reports().dump_json(report, indent=1)


def map_report_from_json(data: bytes) -> MapReport:
    """A stored report."""
    return _reports().validate_json(data)
