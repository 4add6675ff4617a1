"""What the commands share that ask something of stored crashes: cohorts, rules, and where their results go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import click

if TYPE_CHECKING:
    from trace_dag.cli.complaints import Complaints
    from trace_dag.flow.workspace import Workspace
    from trace_dag.settings import RuleSetName
    from trace_dag.warehouse.build import BuildReport


Found = TypeVar("Found")
rules_option = click.option(
    "--rules",
    type=click.Choice(["trace-dag", "strict", "published"]),
    help="Rules to judge by; default those of the settings.",
)


def judged_by(workspace: Workspace, rules: RuleSetName | None) -> Workspace:
    return workspace.with_settings({"verdict": {"rule_set": rules}} if rules else {})


def cohorts_of(workspace: Workspace, cohort: str | None) -> list[str]:
    from trace_dag.errors import UserError

    registry = workspace.registry
    if cohort is not None:
        return [registry.cohort(cohort).name]
    names = list(registry.cohorts())
    if not names:
        raise UserError(f"no crash is registered in {workspace.root}; see trace-dag ingest")
    return names


def of_each(cohorts: Sequence[str], compared: Callable[[str], Found], complaints: Complaints) -> dict[str, Found]:
    """What was found of every cohort that has something to compare; the last one's complaint if none has."""
    from trace_dag.errors import UserError

    found: dict[str, Found] = {}
    complaint: UserError | None = None
    for name in cohorts:
        try:
            found[name] = compared(name)
        except UserError as error:
            complaint = error
    if complaint is not None and not found:
        complaints.told()  # why there is nothing
        raise complaint
    return found


def into_warehouse(workspace: Workspace, complaints: Complaints) -> BuildReport:
    """Build the warehouse anew with the results just stored; ``complaints`` hears of what had to be left out."""
    from trace_dag.warehouse.build import build_warehouse

    return build_warehouse(workspace.storage, workspace.local_folder, complain=complaints.hear)
