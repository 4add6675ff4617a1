"""Output of the commands: funnels, reasons, tables, and progress bars on the error stream."""

from __future__ import annotations

import csv
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from trace_dag.common.messages.logs import own_stderr, writes_json
from trace_dag.common.messages.wording import printable

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from trace_dag.common.messages.progress import OnProgress
    from trace_dag.common.stage import Stage
    from trace_dag.flow.batch import StaleResult
    from trace_dag.flow.crash_status import CrashStatus

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # as OWASP lists them


def print_statuses(crashes: Mapping[str, CrashStatus]) -> None:
    """Print the funnel beside that of the paper, the final states, the reasons of rejections, and the estimators."""
    from trace_dag.flow.crash_status import FinalState, funnel, makers_in_words

    states = Counter(crash.final_state for crash in crashes.values())
    say()
    print_table(
        ["step", "crashes", "published (TRACE, FSE '26)"],
        [(step.step, step.crashes, step.published) for step in funnel(crashes.values())],
    )
    say()
    said = {state: f"{states[state]} {state.replace('_', ' ')}" for state in FinalState}
    if states[FinalState.VERIFIED]:
        said[FinalState.VERIFIED] += f" ({sum(crash.corroborated for crash in crashes.values())} of them corroborated)"
    say(", ".join(said.values()) + f"; {len(crashes)} in all")
    if without_areas := sum(crash.without_areas for crash in crashes.values()):
        say(f"{without_areas} of the verified are of registers without areas of impact: consistent at most")
    outdated = sum(crash.outdated is not None for crash in crashes.values())
    if outdated:
        say(f"{outdated} of them outdated: the new attempt failed, and the earlier result stands")
    reasons = Counter(
        (crash.stage_reached, crash.reason) for crash in crashes.values() if crash.final_state is FinalState.REJECTED
    )
    if reasons:
        say()
        print_table(
            ["rejected at", "reason", "crashes", "category in the paper"],
            [
                (stage, reason, count, reason.published_category if reason else "")
                for (stage, reason), count in sorted(
                    reasons.items(), key=lambda item: (item[0][0].position if item[0][0] else 0, -item[1])
                )
            ],
        )
    estimated = [crash.made for crash in crashes.values() if crash.made is not None]
    if estimated:
        say()
        say(makers_in_words(estimated))


def print_stale(stale: Iterable[StaleResult]) -> None:
    """Print the stages with outdated results, the number of crashes, and the changes since they were made."""
    by_stage: dict[Stage, list[StaleResult]] = {}
    for each in stale:
        by_stage.setdefault(each.stage, []).append(each)
    print_table(
        ["stale", "crashes", "changed since"],
        [
            (stage, len(found), ", ".join(dict.fromkeys(change for each in found for change in each.changed)))
            for stage, found in sorted(by_stage.items(), key=lambda item: item[0].position)
        ],
    )
    say("trace-dag run makes them again, and what was made from them.")


def print_table(names: Sequence[str], rows: Sequence[Sequence[Any]], *, fit: bool = False) -> None:
    """Print aligned columns, numbers to the right; at full width if the output is not a terminal.

    With ``fit``, rows that are wider than the terminal are printed as a block each, a line for a column.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False, soft_wrap=False)
    texts = [[printable(name) for name in names], *([_cell(value) for value in row] for row in rows)]
    widths = [max(len(line) for cell in column for line in cell.split("\n")) for column in zip(*texts, strict=True)]
    if fit and console.is_terminal and sum(widths) + 3 * (len(widths) - 1) > console.width:
        for row in texts[1:]:
            block = Table.grid(padding=(0, 2))
            for name, text in zip(texts[0], row, strict=True):
                block.add_row(name, text)
            console.print(block)
            console.print()
        return
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, name in enumerate(names):
        numeric = any(row[index] is not None for row in rows) and all(
            row[index] is None or (isinstance(row[index], int | float) and not isinstance(row[index], bool))
            for row in rows
        )
        table.add_column(printable(name), justify="right" if numeric else "left", overflow="fold")
    for row in texts[1:]:
        table.add_row(*row)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=10_000)
    console.print(table)


def print_first(names: Sequence[str], rows: Sequence[Sequence[Any]], most: int, where: str) -> None:
    """Print the first rows as a table, and the number of the others with the command that lists all."""
    print_table(names, rows[:most])
    if len(rows) > most:
        say(f"... and {len(rows) - most} more ({where} lists all)")


def say(text: str = "") -> None:
    """Print a line on standard output without terminal control characters."""
    click.echo(printable(text))


def one_line(text: str, length: int) -> str:
    """Return a text on one line of at most so many characters."""
    joined = " ".join(text.split())
    return joined if len(joined) <= length else f"{joined[: length - 1]}…"


def write_csv(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write comma-separated values to standard output.

    Text that a spreadsheet would take for a formula gets a leading apostrophe; numbers stay as they are.
    """
    in_terminal = sys.stdout.isatty()
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow([_csv_cell(name, in_terminal) for name in names])
    writer.writerows([_csv_cell(value, in_terminal) for value in row] for row in rows)


def write_json(value: object) -> None:
    """Write JSON to standard output, dates and the like as text."""
    say(json.dumps(value, indent=1, ensure_ascii=False, default=str))


def _csv_cell(value: object, in_terminal: bool) -> object:
    """Return a value as CSV has it.

    >>> _csv_cell("=1+1", False), _csv_cell("-5", False), _csv_cell(-5.0, False)
    ("'=1+1", '-5', -5.0)
    """
    if not isinstance(value, str):
        return value
    text = printable(value) if in_terminal else value
    return f"'{text}" if text.startswith(_FORMULA) and not _is_number(text) else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(str(value))


# --- progress --------------------------------------------------------------------------------------------------------
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
