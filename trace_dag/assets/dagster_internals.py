"""All that is used of Dagster beside its public interface, and how to do without it.

Names that begin with an underscore may change with any version. They are used with the versions they were tried with,
:data:`TRIED`; with any other one this module warns, and Dagster's public ways take their place: its own event log
instead of ours (:mod:`trace_dag.assets.event_log`; slower, ten times as large, and empty until ``verify --repair`` has
told it what stands), what runs print kept in files instead of shown on the terminal, and checks of crashes that do not
name the materialization they looked at.
"""

import re
import warnings
from typing import TYPE_CHECKING, Any, Final

import dagster
from dagster import DagsterInstance

TRIED: Final = ((1, 13, 20), (1, 14, 0))
"""From the first of these versions on, up to the second one, which is not among them; as ``pyproject.toml`` asks."""

EVENT_LOG_SETTINGS: Final = """\
event_log_storage:
  module: trace_dag.assets.event_log
  class: EventLog
  config: {}
"""
"""What names our event log in a ``dagster.yaml``."""
_NOT_TRIED = "# event_log_storage: Dagster's own; trace-dag's was not tried with this version of Dagster\n"
# What a command's own runs print goes to its terminal, not by way of files and processes that copy them there.
_ON_THE_TERMINAL = {
    "compute_logs": {"module": "dagster._core.storage.noop_compute_log_manager", "class": "NoOpComputeLogManager"}
}


def is_tried(version: str) -> bool:
    """Whether a version of Dagster is one of those whose private parts are known.

    >>> is_tried("1.13.27"), is_tried("1.14.0"), is_tried("1.13.19")
    (True, False, False)
    """
    numbers = re.match(r"(\d+)\.(\d+)\.(\d+)", version)
    return numbers is not None and TRIED[0] <= tuple(map(int, numbers.groups())) < TRIED[1]


KNOWN: Final = is_tried(dagster.__version__)
"""Whether the installed Dagster is one of those versions."""

if TYPE_CHECKING or KNOWN:
    from dagster._core.definitions.asset_checks.asset_check_evaluation import (
        AssetCheckEvaluationTargetMaterializationData,
    )
    from dagster._core.instance.ref import InstanceRef
    from dagster._core.storage.event_log import SqliteEventLogStorage as SqliteEventLogStorage
    from dagster._core.storage.event_log.schema import AssetCheckExecutionsTable as AssetCheckExecutionsTable
    from dagster._core.storage.event_log.schema import AssetKeyTable as AssetKeyTable
    from dagster._core.storage.event_log.schema import DynamicPartitionsTable as DynamicPartitionsTable
    from dagster._core.storage.event_log.schema import SqlEventLogStorageTable as SqlEventLogStorageTable
    from dagster._serdes import ConfigurableClassData as ConfigurableClassData
else:
    warnings.warn(
        f"trace-dag was tried with Dagster {'.'.join(map(str, TRIED[0]))} up to {'.'.join(map(str, TRIED[1]))}, and "
        f"{dagster.__version__} is installed: it works with Dagster's own event log, which takes longer",
        RuntimeWarning,
        stacklevel=2,
    )


def fitting(instance_settings: str) -> str:
    """The text of a ``dagster.yaml`` that names our event log, for the installed version: a comment where ours is not
    used, and our event log again where a version that was tried has come back. Whatever else it says stays."""
    if KNOWN:
        return instance_settings.replace(_NOT_TRIED, EVENT_LOG_SETTINGS)
    return instance_settings.replace(EVENT_LOG_SETTINGS, _NOT_TRIED)


def open_instance(dagster_home: str) -> DagsterInstance:
    """The instance of a folder that the environment's ``DAGSTER_HOME`` names."""
    if KNOWN:
        return DagsterInstance.from_ref(InstanceRef.from_dir(dagster_home, overrides=_ON_THE_TERMINAL))
    return DagsterInstance.get()


def looked_at(storage_id: int, run_id: str, time_s: float) -> Any:
    """What a check looked at: the materialization of that number; None where there is no way to say so."""
    if not KNOWN:
        return None
    return AssetCheckEvaluationTargetMaterializationData(storage_id=storage_id, run_id=run_id, timestamp=time_s)
