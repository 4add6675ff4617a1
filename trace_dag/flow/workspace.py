"""One storage root with its settings and the flow: opened once by a command and handed to all that it calls."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.settings import Settings
from trace_dag.common.settings_sources import DescribedSetting, described_settings, load_settings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.completeness import filters_of
from trace_dag.flow.cohorts.registry import Registry
from trace_dag.flow.contract import Flow
from trace_dag.flow.executors import Executor, make_executor
from trace_dag.flow.stages import FLOW
from trace_dag.flow.tasks import StageEvent

ROOT_VARIABLE = "TRACE_DAG_ROOT"
DEFAULT_ROOT = "trace_dag_home"
SETTINGS_FILE = "settings.toml"
WAREHOUSE_FILE = "warehouse.duckdb"
BUILDING = ".building-"  # folders in which a warehouse is being built begin so


def storage_root(chosen: str | None = None) -> str:
    """Return the storage root: the one chosen, else ``TRACE_DAG_ROOT``, else ``./trace_dag_home``."""
    return chosen or os.environ.get(ROOT_VARIABLE) or DEFAULT_ROOT


@dataclass(frozen=True)
class Workspace:
    """A storage root: what is stored, the settings in force, and the flow that makes it.

    For progress bars, ``listener`` is called with every stage and crash as it is done, and ``page_listener`` how many
    crashes have got their page and package, of how many. ``executor`` is used instead of one made for each piece of
    work.
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
        """Return the workspace of a root, with its ``settings.toml``, the environment and ``overrides`` over them.

        With ``to_read`` the root need not be writable. Raises :class:`trace_dag.common.errors.UserError` for a root
        that cannot be used and settings that do not hold.
        """
        storage = Storage.open(root, to_read=to_read)
        return cls(storage, _settings(storage, overrides), flow)

    def with_settings(self, overrides: Mapping[str, Any]) -> Workspace:
        """Return a copy with ``overrides`` in place of the ones it was opened with.

        Itself if ``overrides`` is empty.
        """
        return replace(self, settings=_settings(self.storage, overrides)) if any(overrides.values()) else self

    def with_one_ledger(self, overrides: Mapping[str, Any]) -> tuple[Workspace, Mapping[str, Any]]:
        """Return the workspace, and the overrides, with a name under which several runs share one budget for models."""
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
        return Registry(self.storage)

    @property
    def pages_in_runs(self) -> bool:
        """Return whether runs make packages and pages.

        Not where there are many crashes, of which few will be looked at.
        """
        return len(self.registry.keys()) <= self.settings.execution.pages_up_to

    @property
    def local_folder(self) -> Path:
        """Return a local folder for what must be local (Dagster's database, the warehouse being built).

        The root itself if it is local; else a folder of the user's own for this root.
        """
        return self.storage.local_folder

    @property
    def warehouse(self) -> Path:
        """Return the warehouse as it is read on this machine."""
        return self.local_folder / WAREHOUSE_FILE

    @property
    def dagster_home(self) -> Path:
        """Return the folder of Dagster's records of this root."""
        return self.local_folder / "dagster"

    @contextmanager
    def executing(self) -> Iterator[Executor]:
        """Provide the executor given, or one of the settings' kind that is closed in the end."""
        if self.executor is not None:
            yield self.executor
            return
        with closing(make_executor(self.settings.execution)) as executor:
            yield executor


def settings_of(root: str) -> list[DescribedSetting]:
    """Return every setting in force for a root, with where its value comes from."""
    storage = Storage(root)
    return described_settings(_settings_file(storage), name=storage.path(SETTINGS_FILE))


def stored_settings(root: str) -> Settings:
    """Return the settings in force for a root, which is only read and need not be there."""
    return _settings(Storage(root), None)


def _settings_file(storage: Storage) -> bytes:
    try:
        return storage.read(SETTINGS_FILE)
    except FileNotFoundError:
        return b""


def _settings(storage: Storage, overrides: Mapping[str, Any] | None) -> Settings:
    settings = load_settings(_settings_file(storage), name=storage.path(SETTINGS_FILE), overrides=overrides)
    filters_of(settings.crash)  # a filter that names no element is said before anything runs
    return settings
