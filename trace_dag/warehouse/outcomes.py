"""The outcome records of all crashes as Arrow tables: where each stands, what each stage said, which files it left.

Some hundred crashes at a time are read and only rows are kept, so that memory does not grow with the records.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from trace_dag.errors import Stage
from trace_dag.pipeline.records import Records, read_records
from trace_dag.pipeline.standing import standing, valid_records
from trace_dag.provenance import EarlierOutcome, Outcome, OutcomeRecord
from trace_dag.storage import Storage

if TYPE_CHECKING:
    import pyarrow as pa

Row = dict[str, Any]

_CRASHES_AT_ONCE = 500

_TEXT, _INTEGER, _BIG, _REAL, _BOOLEAN = "string", "int32", "int64", "float64", "bool"
_COLUMNS: Mapping[str, Mapping[str, str]] = {
    "standing": dict.fromkeys(("key", "cohort", "final_state", "stage_reached", "reason", "detail"), _TEXT),
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
    "artefact": {**dict.fromkeys(("key", "stage", "file", "sha256"), _TEXT), "bytes": _BIG},
}


@dataclass(frozen=True)
class Outcomes:
    """The tables by name, and the names of the artefacts that still count by stage and extension (``"json"``)."""

    tables: Mapping[str, pa.Table]
    files: Mapping[tuple[Stage, str], Sequence[str]]


def read_outcomes(storage: Storage, cohort_of: Mapping[str, str]) -> Outcomes:
    """Everything the stored records say of some crashes, given by key with their cohorts."""
    import pyarrow as pa

    schemas = {
        table: pa.schema([(name, pa.type_for_alias(alias)) for name, alias in columns.items()])
        for table, columns in _COLUMNS.items()
    }
    parts: dict[str, list[pa.Table]] = {table: [schema.empty_table()] for table, schema in schemas.items()}
    files: dict[tuple[Stage, str], list[str]] = {}
    keys = list(cohort_of)
    for start in range(0, len(keys), _CRASHES_AT_ONCE):
        rows: dict[str, list[Row]] = {table: [] for table in schemas}
        for key, records in read_records(storage, keys[start : start + _CRASHES_AT_ONCE]).items():
            valid = valid_records(records)
            rows["standing"].append(_standing_row(key, cohort_of[key], records))
            rows["outcome"].extend(_outcome_row(record) for record in valid.values())
            rows["known_outcome"].extend(_known_rows(records, valid))
            for record in valid.values():
                for file in record.artefacts:
                    rows["artefact"].append(
                        {
                            "key": key,
                            "stage": record.stage.value,
                            "file": file.name,
                            "sha256": file.sha256,
                            "bytes": file.size,
                        }
                    )
                    extension = file.name.rpartition("/")[2].partition(".")[2]
                    files.setdefault((record.stage, extension), []).append(file.name)
        for table, schema in schemas.items():
            parts[table].append(pa.Table.from_pylist(rows[table], schema=schema))
    return Outcomes({table: pa.concat_tables(each) for table, each in parts.items()}, files)


def _standing_row(key: str, cohort: str, records: Records) -> Row:
    stands = standing(key, records)
    return {
        "key": key,
        "cohort": cohort,
        "final_state": stands.final_state.value,
        "stage_reached": stands.stage_reached.value if stands.stage_reached else None,
        "reason": stands.reason.value if stands.reason else None,
        "detail": stands.detail or None,
    }


def _outcome_row(record: OutcomeRecord) -> Row:
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
        "settings": json.dumps(record.provenance.settings, sort_keys=True),
        "transient": record.transient,
    }


def _known_rows(records: Records, valid: Records) -> Iterator[Row]:
    """Every outcome that is known of a crash, stage by stage in order: those replaced since, and the last."""
    for stage, record in records.items():
        known: list[EarlierOutcome | OutcomeRecord] = [*record.history, record]
        known = [each for each in known if each.outcome is not Outcome.STARTED]
        for number, each in enumerate(known, start=1):
            yield {
                "key": record.key,
                "stage": stage.value,
                "stage_number": stage.position + 1,
                "number": number,
                "outcome": each.outcome.value,
                "reason": each.reason.value if each.reason else None,
                "detail": each.detail or None,
                "started_at": each.started_at,
                "run_id": each.run_id,
                "fingerprint": each.fingerprint,
                "standing": each is record and stage in valid,
            }
