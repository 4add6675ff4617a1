"""Shared by the commands that run studies: choosing cohorts and rules, storing the results.

Damaged crashes and files that a command left out are listed once at its end, each with its remedy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import click

from trace_dag.cli.printing import one_line
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.messages.logs import print_problem

if TYPE_CHECKING:
    from trace_dag.common.settings import RuleSetName
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.build import BuildReport

Found = TypeVar("Found")
rules_option = click.option(
    "--rules",
    type=click.Choice(["trace-dag", "strict", "published"]),
    help="Rules to judge by; default those of the settings.",
)
_SHOWN = 20
_LINE = 500


def apply_rules(workspace: Workspace, rules: RuleSetName | None) -> Workspace:
    """Return the workspace with other rules for judging, or unchanged if none are given."""
    return workspace.with_settings({"verdict": {"rule_set": rules}} if rules else {})


def run_for_cohorts(
    workspace: Workspace, cohort: str | None, study: Callable[[str], Found], problems: Problems
) -> dict[str, Found]:
    """Return a study of one cohort, or of each.

    If nothing can be studied, the collected problems are printed before the error is raised.
    """
    from trace_dag.flow.stored_crashes import cohorts_of, study_each

    try:
        return study_each(cohorts_of(workspace, cohort), study)
    except UserError:
        problems.print_all()
        raise


def into_warehouse(workspace: Workspace, problems: Problems) -> BuildReport:
    """Build the warehouse with the results just stored; ``problems`` is called with each omitted crash or file."""
    from trace_dag.warehouse.build import build_warehouse

    return build_warehouse(workspace.storage, workspace.local_folder, on_problem=problems.add)


# --- problems --------------------------------------------------------------------------------------------------------
class Problems:
    """Collects damaged crashes and files while a command does the rest."""

    def __init__(self) -> None:
        self._said: dict[str, None] = {}

    def add(self, failure: Failure) -> None:
        """Remember a complaint, each only once."""
        self._said[str(failure)] = None

    def print_all(self) -> int:
        """Print the collected problems; return the exit code, 1 if there are any."""
        for said in list(self._said)[:_SHOWN]:
            print_problem(f"failed: {one_line(said, _LINE)}")
        if len(self._said) > _SHOWN:
            print_problem(f"failed: {len(self._said) - _SHOWN} more; trace-dag verify --contents lists them")
        return 1 if self._said else 0
