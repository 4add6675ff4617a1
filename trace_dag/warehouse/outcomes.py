"""Outcome records of all crashes as Arrow tables, and the documents that the tables need as tables of DuckDB.

The snapshot of all stored crashes is consistent while batches go on writing. A document counts only with the digest in
its record. If one has been replaced since its record was read, the crash is read again. If that happens repeatedly,
only its settled part enters, as for a crash with a started stage. Some hundred crashes at a time are read, so that
memory does not grow with the cohort.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import DamagedFile, Failure
from trace_dag.common.provenance import EarlierOutcome, Outcome, OutcomeRecord
from trace_dag.common.schemas import table_from_parquet
from trace_dag.common.stage import Stage
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.common.storage.files import Storage
from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.flow.contract import DamagedArtefactError
from trace_dag.flow.crash_status import status_of_valid, valid_records
from trace_dag.flow.records import OnProblem, Records, read_records

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

Row = dict[str, Any]

_TEXT, _INTEGER, _BIG, _REAL, _BOOLEAN = "string", "int32", "int64", "float64", "bool"
_COLUMNS: Mapping[str, Mapping[str, str]] = {
    "standing": dict.fromkeys(
        ("key", "cohort", "final_state", "stage_reached", "reason", "detail", "outdated", "outdated_because"), _TEXT
    ),
    "outcome": {
        **dict.fromkeys(("key", "stage", "outcome", "reason", "published_category", "detail", "error"), _TEXT),
        **dict.fromkeys(("started_at", "run_id", "fingerprint", "code_version", "settings"), _TEXT),
        **dict.fromkeys(("stage_number", "attempts", "artefacts"), _INTEGER),
        **dict.fromkeys(("measured", "threshold", "duration_s"), _REAL),
        "artefact_bytes": _BIG,
        "transient": _BOOLEAN,
    },
    "known_outcome": {
        **dict.fromkeys(("key", "stage", "outcome", "reason", "detail"), _TEXT),
        **dict.fromkeys(("started_at", "run_id", "fingerprint"), _TEXT),
        **dict.fromkeys(("stage_number", "number"), _INTEGER),
        "standing": _BOOLEAN,
    },
    "failed_attempt": {
        **dict.fromkeys(("key", "stage", "detail", "started_at", "run_id", "error"), _TEXT),
        "attempts": _INTEGER,
        "transient": _BOOLEAN,
    },
    "artefact": {**dict.fromkeys(("key", "stage", "file", "sha256"), _TEXT), "bytes": _BIG},
}
_CRASHES_AT_ONCE = 250
_ATTEMPTS = 3


class OutcomeTables:
    """Rows of the tables, crash by crash, and the Arrow tables made of them."""

    def __init__(self) -> None:
        import pyarrow as pa

        self._schemas = {
            table: pa.schema([(name, pa.type_for_alias(alias)) for name, alias in columns.items()])
            for table, columns in _COLUMNS.items()
        }
        self._parts: dict[str, list[pa.Table]] = {
            table: [schema.empty_table()] for table, schema in self._schemas.items()
        }
        self._settings_before: dict[Stage, tuple[dict[str, Any], str]] = {}

    def add(self, crashes: Sequence[CrashSnapshot], cohort_of: Mapping[str, str]) -> None:
        """Add some crashes."""
        import pyarrow as pa

        rows: dict[str, list[Row]] = {table: [] for table in self._schemas}
        for crash in crashes:
            rows["standing"].append(_standing_row(crash, cohort_of[crash.key]))
            rows["outcome"].extend(_outcome_row(record, self._settings(record)) for record in crash.valid.values())
            rows["known_outcome"].extend(_known_rows(crash))
            rows["failed_attempt"].extend(_failed_attempts(crash))
            rows["artefact"].extend(_artefact_rows(crash))
        for table, schema in self._schemas.items():
            self._parts[table].append(pa.Table.from_pylist(rows[table], schema=schema))

    def _settings(self, record: OutcomeRecord) -> str:
        """Return the settings of a record as JSON; those of a stage are usually equal to the previous crash's."""
        settings = record.provenance.settings
        before = self._settings_before.get(record.stage)
        if before is None or before[0] != settings:
            before = self._settings_before[record.stage] = (settings, json.dumps(settings, sort_keys=True))
        return before[1]

    def finished(self) -> dict[str, pa.Table]:
        """Return the tables by name."""
        import pyarrow as pa

        return {table: pa.concat_tables(parts) for table, parts in self._parts.items()}


def _standing_row(crash: CrashSnapshot, cohort: str) -> Row:
    status = status_of_valid(crash.key, crash.valid)
    return {
        "key": crash.key,
        "cohort": cohort,
        "final_state": status.final_state.value,
        "stage_reached": status.stage_reached.value if status.stage_reached else None,
        "reason": status.reason.value if status.reason else None,
        "detail": status.detail or None,
        "outdated": status.outdated.value if status.outdated else None,
        "outdated_because": status.outdated_because or None,
    }


def _failed_attempts(crash: CrashSnapshot) -> Iterator[Row]:
    """Yield the failed attempts: at a stage, or anew at a stage whose earlier result still counts."""
    for stage, record in crash.valid.items():
        failed = record if record.outcome is Outcome.FAILED else record.failed_attempt
        if failed is not None:
            yield {
                "key": crash.key,
                "stage": stage.value,
                "detail": failed.detail or None,
                "started_at": failed.started_at,
                "run_id": failed.run_id,
                "error": failed.error or None,
                "attempts": failed.attempts,
                "transient": failed.transient,
            }


def _outcome_row(record: OutcomeRecord, settings: str) -> Row:
    return {
        "key": record.key,
        "stage": record.stage.value,
        "stage_number": record.stage.position + 1,
        "outcome": record.outcome.value,
        "reason": record.reason.value if record.reason else None,
        "published_category": record.reason.published_category.value if record.reason else None,
        "detail": record.detail or None,
        "error": record.error or None,
        "measured": record.measured,
        "threshold": record.threshold,
        "duration_s": record.duration_s,
        "started_at": record.started_at,
        "run_id": record.run_id,
        "attempts": record.attempts,
        "artefacts": len(record.artefacts),
        "artefact_bytes": sum(file.size for file in record.artefacts),
        "fingerprint": record.fingerprint,
        "code_version": record.provenance.code,
        "settings": settings,
        "transient": record.transient,
    }


def _artefact_rows(crash: CrashSnapshot) -> Iterator[Row]:
    for stage, record in crash.valid.items():
        for file in record.artefacts:
            yield {"key": crash.key, "stage": stage.value, "file": file.name, "sha256": file.sha256, "bytes": file.size}


def _known_rows(crash: CrashSnapshot) -> Iterator[Row]:
    """Yield every known outcome of a crash, stage by stage in order: earlier ones first, then the present one."""
    for stage, record in crash.records.items():
        known: list[EarlierOutcome | OutcomeRecord] = [*record.history, record]
        known = [each for each in known if each.outcome is not Outcome.STARTED]
        for number, each in enumerate(known, start=1):
            yield {
                "key": crash.key,
                "stage": stage.value,
                "stage_number": stage.position + 1,
                "number": number,
                "outcome": each.outcome.value,
                "reason": each.reason.value if each.reason else None,
                "detail": each.detail or None,
                "started_at": each.started_at,
                "run_id": each.run_id,
                "fingerprint": each.fingerprint,
                "standing": each is record and stage in crash.valid,
            }


# --- the snapshot ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class CrashSnapshot:
    """One crash: all its records, the valid ones, and its documents by stage and extension."""

    key: str
    records: Records
    valid: Records
    documents: Mapping[tuple[Stage, str], bytes]


def read_snapshots(
    storage: Storage, keys: Sequence[str], documents: Collection[tuple[Stage, str]], on_problem: OnProblem
) -> Iterator[list[CrashSnapshot]]:
    """Yield some crashes at a time, in order, each with its documents: artefacts by stage and extension.

    ``on_problem`` is called with the errors of damaged records and documents; the undamaged part of their crash enters.
    """
    for start in range(0, len(keys), _CRASHES_AT_ONCE):
        chunk = keys[start : start + _CRASHES_AT_ONCE]
        settled: dict[str, CrashSnapshot] = {}
        for attempt in range(1, _ATTEMPTS + 1):
            unsettled = [key for key in chunk if key not in settled]
            for snapshot, damaged in _read(storage, unsettled, documents, on_problem):
                if damaged is None:
                    settled[snapshot.key] = snapshot
                elif attempt == _ATTEMPTS:
                    on_problem(damaged)
                    settled[snapshot.key] = snapshot
            if len(settled) == len(chunk):
                break
        yield [settled[key] for key in chunk]


def _read(
    storage: Storage, keys: Sequence[str], documents: Collection[tuple[Stage, str]], on_problem: OnProblem
) -> Iterator[tuple[CrashSnapshot, DamagedFile | None]]:
    """Yield each crash up to the first document that differs from its record, with the fault of that document."""
    records = read_records(storage, keys, on_problem=on_problem)
    valid = {key: valid_records(of_crash) for key, of_crash in records.items()}
    listed = {
        (key, stage, extension): file
        for key, of_crash in valid.items()
        for stage, extension in documents
        if stage in of_crash and (file := of_crash[stage].artefact(extension)) is not None
    }
    contents = storage.read_many((file.name for file in listed.values()), unreadable=lambda _: None)  # told of below
    for key, of_crash in valid.items():
        found: dict[tuple[Stage, str], bytes] = {}
        damaged = None
        for stage, extension in sorted(documents, key=lambda document: document[0].position):
            file = listed.get((key, stage, extension))
            if file is None:
                continue
            data = contents.get(file.name)
            if data is None or not file.matches(data):
                damaged = DamagedArtefactError(key, stage, file.name, "not the file its record lists")
                of_crash = {each: record for each, record in of_crash.items() if each.position < stage.position}
                break
            found[stage, extension] = data
        yield CrashSnapshot(key, records[key], of_crash, found), damaged


# --- documents -------------------------------------------------------------------------------------------------------
_RECORD = (Stage.CRASH_RECORD, "parquet")
_JSON = {
    "map_report": (Stage.ROAD_MAP, "json"),
    "estimate": (Stage.STATE_ESTIMATE, "json"),
    "simulation": (Stage.SIMULATION_LOG, "json"),
    "sampled": (Stage.SIMULATION_LOG, "samples.json"),
    "verdict": (Stage.VERDICT, "json"),
}
DOCUMENTS = (_RECORD, *_JSON.values())


class DocumentTables:
    """Loads the artefacts of some crashes at a time."""

    def __init__(self, connection: duckdb.DuckDBPyConnection) -> None:
        self._connection = connection
        self._made = False
        self.add([])

    def add(self, crashes: Sequence[CrashSnapshot]) -> None:
        """Load some crashes."""
        import pyarrow as pa

        records = [table_from_parquet(crash.documents[_RECORD]) for crash in crashes if _RECORD in crash.documents]
        # Records of an older version may lack columns, in their vehicles and persons too.
        columns = pa.schema([_optional(field) for field in CRASH_RECORD.arrow()]).empty_table()
        self._take("crash_record", pa.concat_tables([columns, *records], promote_options="permissive"))
        for name, document in _JSON.items():
            found = [(crash.key, crash.documents[document]) for crash in crashes if document in crash.documents]
            keys, contents = ([each[column] for each in found] for column in (0, 1))
            texts = pa.array(contents, pa.binary()).cast(pa.string())  # never texts of Python's
            self._take(name, pa.table({"key": pa.array(keys, pa.string()), "content": texts}))
        self._made = True

    def _take(self, name: str, documents: pa.Table) -> None:
        into = f"INSERT INTO {name}" if self._made else f"CREATE TEMP TABLE {name} AS"
        self._connection.register("document", documents)
        execute_sql(self._connection, f"documents/{name}", prefix=into)
        self._connection.unregister("document")


def _optional(field: pa.Field) -> pa.Field:
    """Return a field that may be null, like all fields within it."""
    import pyarrow as pa

    kind = field.type
    if pa.types.is_list(kind):
        kind = pa.list_(_optional(kind.value_field))
    elif pa.types.is_struct(kind):
        kind = pa.struct([_optional(each) for each in kind])
    return pa.field(field.name, kind)


def local_files(storage: Storage, names: Sequence[str], folder: Path) -> list[str]:
    """Return local paths of stored JSON files for DuckDB, with copies in ``folder`` if the storage is remote.

    DuckDB needs at least one file to infer the columns, so an empty one is always the first.
    """
    empty = folder / "empty.json"
    empty.write_text("[]")
    paths = [str(empty)]
    if storage.local_root is not None:
        return paths + [storage.path(name) for name in names]
    for name, data in storage.read_many(names).items():
        copy = folder / name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(data)
        paths.append(str(copy))
    return paths


def execute_sql(connection: duckdb.DuckDBPyConnection, name: str, *, prefix: str = "") -> None:
    """Run one of the ``.sql`` files.

    Raises ``FileNotFoundError`` for missing data files, :class:`Failure` for other errors.
    """
    import duckdb

    sql = resources.files("trace_dag.warehouse").joinpath("sql", f"{name}.sql").read_text()
    try:
        connection.execute(f"BEGIN; {prefix} {sql}; COMMIT")  # else each comment on a column is written by itself
    except duckdb.Error as error:
        if (failure := disk_failure(error)) is not None:
            raise failure from error
        if isinstance(error, duckdb.IOException):
            raise FileNotFoundError(str(error)) from error
        raise Failure(f"{name}.sql: {error}") from error
