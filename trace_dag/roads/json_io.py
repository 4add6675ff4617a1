"""The report that is stored beside a road map, to and from JSON."""

from __future__ import annotations

from functools import cache

from pydantic import TypeAdapter

from trace_dag.roads.report import MapReport, RejectedMapReport


@cache
def _reports() -> TypeAdapter[MapReport]:
    return TypeAdapter(MapReport)


def map_report_to_json(report: MapReport) -> bytes:
    """Return the report as stored.

    >>> import json
    >>> json.loads(map_report_to_json(map_report))["placement"]["moved_m"]
    0.0
    """
    return _reports().dump_json(report, indent=1)


def map_report_from_json(data: bytes) -> MapReport:
    """Return a stored report."""
    return _reports().validate_json(data)


@cache
def _rejected() -> TypeAdapter[RejectedMapReport]:
    return TypeAdapter(RejectedMapReport)


def rejected_report_to_json(report: RejectedMapReport) -> bytes:
    """Return the report on a map for which its crash is rejected, as stored.

    >>> import json
    >>> from trace_dag.roads.report import RejectedMapReport
    >>> json.loads(rejected_report_to_json(RejectedMapReport("native", 30.0, ())))["max_move_m"]
    30.0
    """
    return _rejected().dump_json(report, indent=1)


def rejected_report_from_json(data: bytes) -> RejectedMapReport:
    """Return a stored report on a map for which its crash is rejected.

    >>> rejected_report_from_json(b'{"converter": "native", "max_move_m": 30, "streets": []}').max_move_m
    30.0
    """
    return _rejected().validate_json(data)
