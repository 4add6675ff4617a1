"""The raw report of a crash from a table, as a JSON document.

For FARS it has the rows of the tables, unchanged. For another register, whose mapping is not kept, it has the record as
read, before completion, with the fields that differ from their defaults.
"""

from __future__ import annotations

import json

from pydantic import ValidationError

from trace_dag.common.json_adapters import json_adapter
from trace_dag.crash.fars.rows import FarsRows
from trace_dag.crash.fields import malformed
from trace_dag.crash.record import CrashRecord


def is_json(data: bytes) -> bool:
    """Return whether a report is such a JSON document rather than XML.

    >>> is_json(report_xml), is_json(b'{"key": "tempe-1"}')
    (False, True)
    """
    return data.lstrip()[:1] == b"{"


def report_to_json(report: FarsRows | CrashRecord) -> bytes:
    """Return the document of a table's report."""
    kind: type[FarsRows | CrashRecord] = type(report)
    return json_adapter(kind).dump_json(report, exclude_defaults=True, indent=1) + b"\n"


def report_from_json(data: bytes, *, name: str) -> FarsRows | CrashRecord:
    """Return the rows or the record in a document.

    Raises :class:`trace_dag.common.errors.Rejection` (``malformed_report``) for any other document.

    >>> report_from_json(report_to_json(record), name="a report").key
    '2023-319003'
    """
    try:
        kind: type[FarsRows | CrashRecord] = FarsRows if "tables" in json.loads(data) else CrashRecord
        found = json_adapter(kind).validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise malformed(f"{name}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    except (ValueError, RecursionError) as error:
        raise malformed(f"{name} is not JSON: {error}") from error
    return found
