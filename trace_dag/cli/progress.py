"""Progress bars on the terminal's error stream, for every command that may take long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from trace_dag.common.messages.logs import own_stderr, writes_json

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from trace_dag.common.messages.progress import OnProgress


@contextmanager
def progress_of(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """Show a bar over a known number of items; yield a function to call with the name of each finished item."""
    with _bar() as progress:
        task = progress.add_task(what, total=total)
        yield lambda name: progress.update(task, advance=1, description=name)


@contextmanager
def progress_bar(what: str) -> Iterator[OnProgress]:
    """Show a bar from the first call on; yield a function to call with the numbers done and in total."""
    progress = _bar()
    tasks: list[TaskID] = []

    def on_progress(done: int, total: int) -> None:
        progress.start()
        tasks[:] = tasks or [progress.add_task(what, total=None)]
        progress.update(tasks[0], completed=done, total=total)

    try:
        yield on_progress
    finally:
        if progress.live.is_started:
            progress.stop()


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(file=own_stderr()), disable=writes_json())
