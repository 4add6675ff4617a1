"""The stored crash record: a Parquet file of one row, with vehicles, events and non-motorists as lists of structs.

Every column is declared once, in ``crash_record.csv``: name with its unit, type, meaning and the FARS element it comes
from. The schema of the files, the conversion both ways and the data dictionary follow from it. All files have the same
schema, so that DuckDB and pandas read those of a root as one table (``read_parquet('crash_record/*.parquet')``).
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import Failure
from trace_dag.common.schemas import TableSchema, table_from_parquet
from trace_dag.crash.record import CrashRecord

if TYPE_CHECKING:
    import pyarrow as pa

SCHEMA_VERSION: Final = 4
"""Version of :data:`CRASH_RECORD`, in every file: raised when a column comes, goes or changes its meaning."""
CRASH_RECORD: Final = TableSchema.of_csv("trace_dag.crash", "crash_record", "One crash as read from its report")


def record_to_parquet(record: CrashRecord) -> bytes:
    """Return the record as a Parquet file of one row with the columns of :data:`CRASH_RECORD`.

    >>> record_to_parquet(record)[:4]
    b'PAR1'
    """
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    # Of a single row the statistics and a second copy of the schema would be most of the file.
    pq.write_table(records_table([record]), buffer, store_schema=False, write_statistics=False)
    return buffer.getvalue()


def records_table(records: Iterable[CrashRecord]) -> pa.Table:
    """Return some records as one table with the columns of :data:`CRASH_RECORD`.

    >>> records_table([record]).column("fatalities").to_pylist()
    [1]
    """
    import pyarrow as pa

    return pa.Table.from_pylist([_row(each) for each in records], schema=CRASH_RECORD.arrow())


def _row(record: CrashRecord) -> dict[str, Any]:
    """Return the fields of a record, with derived values for readers of the table."""
    row: dict[str, Any] = json_adapter(CrashRecord).dump_python(record, mode="json")
    events = [{**stored, "kind": event.kind.value} for stored, event in zip(row["events"], record.events, strict=True)]
    persons = [
        {**stored, "party": person.party, "kind": person.kind.value}
        for stored, person in zip(row["non_motorists"], record.non_motorists, strict=True)
    ]
    severity = record.severity
    derived = {
        "schema_version": SCHEMA_VERSION,
        "kind": record.kind.value,
        "severity": None if severity is None else severity.value,
    }
    return {**row, **derived, "events": events, "non_motorists": persons}


def record_from_parquet(data: bytes) -> CrashRecord:
    """Return the record in a Parquet file.

    Raises :class:`Failure` if the file is damaged or has another schema.
    """
    import pyarrow as pa

    try:
        (row,) = table_from_parquet(data).to_pylist()
        if row["schema_version"] != SCHEMA_VERSION:
            raise ValueError(f"it has schema version {row['schema_version']}, expected {SCHEMA_VERSION}")
        return json_adapter(CrashRecord).validate_python(row)
    except (pa.ArrowException, KeyError, ValueError, OSError) as error:
        raise Failure(
            f"a stored crash record cannot be read ({error}): remove it and run crash_record again"
        ) from error
