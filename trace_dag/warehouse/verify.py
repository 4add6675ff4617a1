"""Verification of the warehouse against the stored records."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.stage import Stage
from trace_dag.flow.crash_status import crash_status, valid_records
from trace_dag.flow.records import Records
from trace_dag.flow.verify import Disagreement, DisagreementKind
from trace_dag.warehouse.build import is_outdated
from trace_dag.warehouse.query import query

_CRASHES = "SELECT key, final_state, stage_reached, reason, outdated FROM crashes"
_OUTCOMES = "SELECT key, stage, fingerprint FROM stage_outcomes"


def verify_warehouse(path: Path, records: Mapping[str, Records]) -> list[Disagreement]:
    """Compare the state of each crash and its stages' outcomes with the records.

    A missing warehouse is one disagreement, but none if nothing has been run. A warehouse of an earlier version is
    outdated (see ``is_outdated``), which is no disagreement.
    """
    if is_outdated(path):
        return []
    if not path.is_file():
        ran = any(records.values())
        return [Disagreement(DisagreementKind.WAREHOUSE, f"{path} is not there", file=str(path))] if ran else []
    try:
        crashes = {row[0]: row[1:] for row in query(path, _CRASHES)[1]}
        outcomes: dict[str, dict[str, str]] = {}
        for key, stage, fingerprint in query(path, _OUTCOMES)[1]:
            outcomes.setdefault(key, {})[stage] = fingerprint
    except DamagedFile as damaged:
        return [Disagreement(DisagreementKind.WAREHOUSE, f"{path}: {damaged.found}", file=str(path))]
    except UserError as error:
        return [Disagreement(DisagreementKind.WAREHOUSE, f"{path} cannot be read: {error}", file=str(path))]
    found = []
    for key in sorted(crashes.keys() | records.keys()):
        found += _of_crash(key, records.get(key), crashes.get(key), outcomes.get(key, {}))
    return found


def _of_crash(
    key: str, records: Records | None, row: tuple[object, ...] | None, outcomes: Mapping[str, str]
) -> list[Disagreement]:
    if records is None:
        return [Disagreement(DisagreementKind.WAREHOUSE, "it is in the warehouse and not registered", key)]
    if row is None:
        return [Disagreement(DisagreementKind.WAREHOUSE, "it is registered and not in the warehouse", key)]
    stand = crash_status(key, records)
    now = (stand.final_state, stand.stage_reached, stand.reason, stand.outdated)
    if tuple(row) != now:
        return [
            Disagreement(
                DisagreementKind.WAREHOUSE, f"stored: {_said(now)}; warehouse: {_said(row)}", key, stand.stage_reached
            )
        ]
    valid = valid_records(records)
    return [
        Disagreement(DisagreementKind.WAREHOUSE, "the warehouse holds another result of this stage", key, stage)
        for stage in Stage
        if outcomes.get(stage.value) != (valid[stage].fingerprint if stage in valid else None)
    ]


def _said(parts: tuple[object, ...]) -> str:
    return ", ".join(str(part) for part in parts if part is not None)
