"""The event log of an instance, where it is ours: what it does beside what Dagster asks of an event log."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from dagster import DagsterInstance

from trace_dag.assets import dagster_internals

if TYPE_CHECKING:
    from trace_dag.assets.event_log import EventLog


def our_log(instance: DagsterInstance) -> EventLog | None:
    """The event log of an instance if it is ours; None for Dagster's own."""
    if not dagster_internals.KNOWN:
        return None
    from trace_dag.assets.event_log import EventLog

    log = instance.event_log_storage
    return log if isinstance(log, EventLog) else None


def written_together(instance: DagsterInstance) -> AbstractContextManager[None]:
    """Within it, materializations are written some at a time, where the log can do that."""
    log = our_log(instance)
    return log.together() if log is not None else nullcontext()
