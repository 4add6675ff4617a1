"""One storage root with its settings and the flow: opened once by a command and handed to all that it calls."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.settings import Settings
from trace_dag.common.settings_sources import DescribedSetting, described_settings, load_settings
from trace_dag.common.storage.files import Storage
from trace_dag.flow.stages import FLOW

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.registry import Registry
    from trace_dag.flow.contract import Flow
    from trace_dag.flow.executors import Executor
    from trace_dag.flow.tasks import StageEvent

ROOT_VARIABLE = "TRACE_DAG_ROOT"
DEFAULT_ROOT = "trace_dag_home"
SETTINGS_FILE = "settings.toml"
WAREHOUSE_FILE = "warehouse.duckdb"
BUILDING = ".building-"  # folders in which a warehouse is being built begin so


def storage_root(chosen: str | None = None) -> str:
    """Return the storage root: ``chosen``, else ``TRACE_DAG_ROOT``, else ``./trace_dag_home``."""
    return chosen or os.environ.get(ROOT_VARIABLE) or DEFAULT_ROOT


@dataclass(frozen=True)
class Workspace:
    """A storage root with its settings and its flow.

    For progress bars, ``listener`` is called with every finished stage and crash, and ``page_listener`` with the
    numbers of crashes that have their page and package, and in total. ``executor``, if given, is used for all work.
    """

    storage: Storage
    settings: Settings
    flow: Flow = FLOW
    listener: Callable[[StageEvent], None] | None = None
    page_listener: OnProgress = silent
    executor: Executor | None = None

    @classmethod
    def open(
        cls, root: str, flow: Flow = FLOW, overrides: Mapping[str, Any] | None = None, *, to_read: bool = False
    ) -> Workspace:
        """Return the workspace of a root, with its ``settings.toml``, the environment and ``overrides``, in that order.

        Later ones win. With ``to_read`` the root need not be writable. Raises
        :class:`trace_dag.common.errors.UserError` for an unusable root and invalid settings.
        """
        storage = Storage.open(root, to_read=to_read)
        return cls(storage, _settings(storage, overrides), flow)

    def with_settings(self, overrides: Mapping[str, Any]) -> Workspace:
        """Return a copy with ``overrides`` in place of the present ones, or the workspace if ``overrides`` is empty."""
        return replace(self, settings=_settings(self.storage, overrides)) if any(overrides.values()) else self

    def with_one_ledger(self, overrides: Mapping[str, Any]) -> tuple[Workspace, Mapping[str, Any]]:
        """Return the workspace and ``overrides`` with a name under which several runs share one model budget."""
        if self.settings.states.llm_ledger is not None:
            return self, overrides
        named = {**overrides, "states": {**overrides.get("states", {}), "llm_ledger": uuid.uuid4().hex}}
        return self.with_settings(named), named

    @property
    def root(self) -> str:
        """Return the storage root: a folder or a URL."""
        return self.storage.root

    @cached_property
    def registry(self) -> Registry:
        """Return the registered crashes."""
        from trace_dag.flow.cohorts.registry import Registry

        return Registry(self.storage)

    @property
    def pages_in_runs(self) -> bool:
        """Return whether runs make pictures, packages and pages, which they do not for many crashes."""
        return len(self.registry.keys()) <= self.settings.execution.pages_up_to

    @property
    def local_folder(self) -> Path:
        """Return the local folder for Dagster's database and the warehouse.

        It is the root itself if that is local, else a folder of the user for this root.
        """
        return self.storage.local_folder

    @property
    def warehouse(self) -> Path:
        """Return the path of the warehouse on this machine."""
        return self.local_folder / WAREHOUSE_FILE

    @property
    def dagster_home(self) -> Path:
        """Return the folder of Dagster's records of this root."""
        return self.local_folder / "dagster"

    @contextmanager
    def executing(self) -> Iterator[Executor]:
        """Yield the given executor, or a new one of the settings' kind that is closed afterwards."""
        if self.executor is not None:
            yield self.executor
            return
        from trace_dag.flow.executors import make_executor

        with closing(make_executor(self.settings.execution)) as executor:
            yield executor


def settings_of(root: str) -> list[DescribedSetting]:
    """Return every setting of a root with its value and the value's source."""
    storage = Storage(root)
    return described_settings(_settings_file(storage), name=storage.path(SETTINGS_FILE))


def stored_settings(root: str) -> Settings:
    """Return the settings of a root, which is only read and need not exist."""
    return _settings(Storage(root), None)


def _settings_file(storage: Storage) -> bytes:
    try:
        return storage.read(SETTINGS_FILE)
    except FileNotFoundError:
        return b""


def _settings(storage: Storage, overrides: Mapping[str, Any] | None) -> Settings:
    settings = load_settings(_settings_file(storage), name=storage.path(SETTINGS_FILE), overrides=overrides)
    if settings.crash.kinds or settings.crash.filters:
        from trace_dag.crash.completeness import filters_of

        filters_of(settings.crash)  # one that names no kind or element is said before anything runs
    return settings
