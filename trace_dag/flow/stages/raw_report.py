"""Stage ``raw_report``: the report as its source serves it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.common.errors import Failure, Reason, Rejection
from trace_dag.crash.folder import identify
from trace_dag.crash.parse import is_json
from trace_dag.flow.cohorts.kept_files import read_kept
from trace_dag.flow.contract import StageProduct

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.registry import ReportSource
    from trace_dag.flow.cohorts.services import Services


def raw_report(key: str, report: ReportSource, services: Services) -> StageProduct:
    """Return the report as its source serves it; reject an answer without a case."""
    try:
        if report.kind == "file":
            data = Path(report.location).read_bytes()
        elif report.kind == "stored":
            data = read_kept(services.storage, key, report)
        else:
            data = services.crash_api().report(key)
    except FileNotFoundError as error:
        raise Failure(f"{report.location}: the report is no longer there; put it back or ingest it again") from error
    if report.sha256 and hashlib.sha256(data).hexdigest() != report.sha256:
        raise Failure(f"{report.location}: the report has changed since it was registered; ingest it again")
    if is_json(data):  # what a table says
        return StageProduct({"json": data}, {"source": report.kind, "bytes": len(data)})
    try:
        found = identify(data, name=report.location)
    except Rejection:
        found = None  # what cannot be read is the next stage's to say
    if found is not None and not found[1]:
        raise Rejection(Reason.NOT_RELEASED, "The report holds no case: it is not released yet.")
    return StageProduct({"xml": data}, {"source": report.kind, "bytes": len(data)})
