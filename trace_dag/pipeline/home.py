"""Where everything of one installation lives: the storage root and, below it or beside it, Dagster's own records."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.executors import Executor
from trace_dag.pipeline.flow import Flow
from trace_dag.pipeline.progress import Progress, untold
from trace_dag.pipeline.tasks import StageEvent
from trace_dag.storage import Storage

ROOT_VARIABLE = "TRACE_DAG_ROOT"
DEFAULT_ROOT = "trace_dag_home"
WAREHOUSE_FILE = "warehouse.duckdb"
BUILDING = ".building-"  # folders in which a warehouse is being built begin so


def storage_root(chosen: str | None = None) -> str:
    """The storage root: the one chosen, else ``TRACE_DAG_ROOT``, else ``./trace_dag_home``."""
    return chosen or os.environ.get(ROOT_VARIABLE) or DEFAULT_ROOT


@dataclass(frozen=True)
class Home:
    """One storage root with a flow.

    For progress bars, ``listener`` hears of every stage and crash as it is done, and ``page_listener`` how many crashes
    have got their page and package, of how many. ``executor`` is used instead of one made for each run.
    """

    root: str
    flow: Flow
    listener: Callable[[StageEvent], None] | None = None
    page_listener: Progress = untold
    executor: Executor | None = None

    def pipeline(self, overrides: Mapping[str, Any] | None = None) -> Pipeline:
        """The pipeline with the root's settings and ``overrides`` over them."""
        return Pipeline.open(self.root, self.flow, overrides)

    @property
    def local_folder(self) -> Path:
        """A local folder for what must be local (Dagster's database, the warehouse being built).

        The root itself if it is local; else a folder of the user's own for this root.
        """
        return Storage(self.root).local_folder

    @property
    def warehouse(self) -> Path:
        """The warehouse as it is read on this machine."""
        return self.local_folder / WAREHOUSE_FILE

    @property
    def dagster_home(self) -> Path:
        """Where Dagster keeps its records of this root."""
        return self.local_folder / "dagster"
