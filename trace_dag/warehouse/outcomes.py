"""The outcome records of all crashes as Arrow tables: states, outcomes of the stages, and files.

The snapshot of all stored crashes is consistent while batches go on writing. A document counts only with the digest in
its record. If one has been replaced since its record was read, the crash is read again. If that happens repeatedly,
only its settled part enters, as for a crash with a started stage. Some hundred crashes at a time are read, so that
memory does not grow with the cohort.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import DamagedFile
from trace_dag.common.provenance import EarlierOutcome, Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.contract import DamagedArtefactError
from trace_dag.flow.crash_status import status_of_valid, valid_records
from trace_dag.flow.records import OnProblem, Records, read_records

if TYPE_CHECKING:
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
            yield {
                "key": crash.key,
                "stage": stage.value,
                "file": file.name,
                "sha256": file.sha256,
                "bytes": file.size,
            }


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
