"""Changes between two builds of the warehouse that are worth an alert: crashes that failed or lost their verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from trace_dag.common.errors import BudgetSpent, DamagedFile, UserError
from trace_dag.common.network.alerts import Alert, AlertedCrash, AlertKind
from trace_dag.common.storage.files import Storage
from trace_dag.flow.crash_status import FinalState
from trace_dag.flow.records import read_records
from trace_dag.warehouse.query import query

_SQL = "SELECT key, final_state, outdated, stage_reached, reason, detail, outdated_because FROM crashes ORDER BY key"
_BUDGET = f"{BudgetSpent.__module__}.{BudgetSpent.__qualname__}:"


def find_troubled(final_state: str, outdated: str | None) -> bool:
    """Return whether a crash is failed, or has a result that could not be made anew.

    >>> find_troubled("failed", None), find_troubled("verified", None)
    (True, False)
    """
    return final_state == FinalState.FAILED or outdated is not None


def standings_in(warehouse: Path) -> dict[str, tuple[str, bool]]:
    """Return the states of the crashes in a warehouse, and whether they are troubled; empty without one."""
    try:
        return {row[0]: (row[1], find_troubled(row[1], row[2])) for row in query(warehouse, _SQL)[1]}
    except (UserError, DamagedFile):
        return {}


def alerts_since(before: Mapping[str, tuple[str, bool]], storage: Storage, warehouse: Path) -> Iterator[Alert]:
    """Return the alerts of a warehouse, given the states of the crashes before its build."""
    failed, fallen = [], []
    for key, state, outdated, stage, reason, detail, because in query(warehouse, _SQL)[1]:
        stood, was_troubled = before.get(key, (None, False))
        if find_troubled(state, outdated) and not was_troubled:
            failed.append(AlertedCrash(key, str(outdated or stage), "", because if outdated else detail))
        elif stood == FinalState.VERIFIED and state == FinalState.REJECTED:
            fallen.append(AlertedCrash(key, str(stage), str(reason), detail))
    spent = _for_the_budget(storage, [crash.key for crash in failed])
    for kind, what, crashes in (
        (AlertKind.BUDGET_SPENT, "stopped by the budget for language models", [c for c in failed if c.key in spent]),
        (AlertKind.FAILED, "failed", [c for c in failed if c.key not in spent]),
        (AlertKind.NO_LONGER_VERIFIED, "no longer verified", fallen),
    ):
        if crashes:
            yield Alert.of_crashes(kind, storage.root, what, crashes)


def _for_the_budget(storage: Storage, keys: list[str]) -> set[str]:
    """Return the failed crashes that stopped because the budget was spent."""
    found = set()
    for key, records in read_records(storage, keys).items():
        errors = [each.error for record in records.values() for each in (record, record.failed_attempt) if each]
        if any(error.strip().rpartition("\n")[2].startswith(_BUDGET) for error in errors if error):
            found.add(key)
    return found
