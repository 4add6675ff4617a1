"""Work done in parallel for each of some crashes; an error in one is reported, and the others go on."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol, TypeVar

from trace_dag.agents.stored_cases import StoredCase
from trace_dag.common.errors import Failure
from trace_dag.flow.executors import run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.workspace import Workspace


class Report(Protocol):
    """A report of one crash: its key, and the error if it broke, else ""."""

    def __init__(self, key: str, *, error: str = "") -> None: ...

    @property
    def key(self) -> str: ...

    @property
    def error(self) -> str: ...


Reported = TypeVar("Reported", bound=Report)


def report_each(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    make: Callable[[StoredCase], Reported],
    report: type[Reported],
    on_progress: Callable[[Reported], None],
) -> list[Reported]:
    """Return the reports that ``make`` gives for the crashes, in order.

    ``on_progress`` is called with each finished report.
    """
    reports: dict[str, Reported] = {}
    with workspace.executing() as executor:
        for case, found in run_redoing_lost(executor, partial(_report, make, report), cases, lambda case: [case]):
            made = report(case.key, error=found.detail) if isinstance(found, Lost) else found
            reports[case.key] = made
            on_progress(made)
    return [reports[case.key] for case in cases]


def _report(make: Callable[[StoredCase], Reported], report: type[Reported], case: StoredCase) -> Reported:
    try:
        return make(case)
    except Failure as failure:
        return report(case.key, error=str(failure))
    except Exception as error:
        # One crash without a result keeps no other from having one.
        return report(case.key, error="".join(traceback.format_exception(error)))
