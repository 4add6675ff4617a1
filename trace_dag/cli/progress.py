"""Progress bars on the terminal's error stream, for every command that may take long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from trace_dag.logs import writes_json

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from trace_dag.progress import MapListener, MapProgress
    from trace_dag.progress import Progress as Told


@contextmanager
def progress_of(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """A bar over a known number of things; it is called with the name of each one done."""
    with progress_of_run(what, total) as (tell, _):
        yield tell


@contextmanager
def progress_of_run(what: str, total: int) -> Iterator[tuple[Callable[[str], None], MapListener]]:
    """The same, and what shows below it how far a large map file is read."""
    with _bar() as progress:
        task = progress.add_task(what, total=total)
        yield lambda name: progress.update(task, advance=1, description=name), _map_rows(progress)


@contextmanager
def progress_told(what: str) -> Iterator[Told]:
    """A bar from the first time it is told how many are done, and of how many."""
    with progress_of_ingest(what) as (tell, _):
        yield tell


@contextmanager
def progress_of_ingest(what: str) -> Iterator[tuple[Told, MapListener]]:
    """The same, and what shows how far a large map file is read."""
    progress = _bar()
    tasks: list[TaskID] = []

    def tell(done: int, total: int) -> None:
        progress.start()
        tasks[:] = tasks or [progress.add_task(what, total=None)]
        progress.update(tasks[0], completed=done, total=total)

    try:
        yield tell, _map_rows(progress)
    finally:
        if progress.live.is_started:
            progress.stop()


def _map_rows(progress: Progress) -> MapListener:
    """A row for each large map file while it is read, in MB."""
    rows: dict[str, TaskID] = {}

    def tell(told: MapProgress) -> None:
        progress.start()
        if told.file not in rows:
            rows[told.file] = progress.add_task(told.file, total=None)
        sites = f" ({told.found:,} of {told.sites:,} sites)" if told.sites else ""
        done, total = told.read // 1_000_000, told.size // 1_000_000
        progress.update(rows[told.file], description=f"{told.file}, MB{sites}", completed=done, total=total)
        if told.read >= told.size:
            progress.remove_task(rows.pop(told.file))

    return tell


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), disable=writes_json())
