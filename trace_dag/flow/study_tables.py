"""Tables of comparisons: ``ROOT/comparisons/<kind>-<cohort>.json``, which the warehouse reads."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import DamagedFile, Failure
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.manifests import list_files, read_listed
from trace_dag.flow.records import OnProblem
from trace_dag.flow.workspace import Workspace

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

FOLDER = "comparisons"
CONTROLS = "controls"
ESTIMATORS = "estimators"
PERTURBED = "perturbed"


def store(workspace: Workspace, kind: str, cohort: str, rows: Sequence[DataclassInstance]) -> None:
    """Store the rows of a comparison of a cohort, replacing earlier ones."""
    judged = {"cohort": cohort, "rule_set": workspace.settings.verdict.rule_set}
    content: list[dict[str, Any]] = [{**judged, **asdict(row)} for row in rows]
    store_comparison(workspace.storage, kind, cohort, content)


_MADE_BY = {
    CONTROLS: "trace-dag controls",
    ESTIMATORS: "python -m lab compare_estimators",
    PERTURBED: "python -m lab perturbed",
}


def is_comparison_whole(storage: Storage, name: str, on_problem: OnProblem) -> bool:
    """Return whether a stored comparison is undamaged; if not, ``on_problem`` is called."""
    kind, _, cohort = name.removeprefix(f"{FOLDER}/").removesuffix(".json").partition("-")
    try:
        remedy = f"{_MADE_BY[kind]} --cohort {cohort} makes it again"
        read_listed(storage, name, remedy=remedy)
    except DamagedFile as damaged:
        on_problem(damaged)
        return False
    return True


def store_comparison(
    storage: Storage, kind: str, cohort: str, rows: Sequence[Mapping[str, Any]], beside: Sequence[StoredFile] = ()
) -> None:
    """Store the rows of a comparison of a cohort, and list them with the files made ``beside``."""
    subject = f"{FOLDER}/{kind}-{cohort}"
    try:
        file = storage.write(f"{subject}.json", json.dumps(rows, indent=0).encode())
    except ValueError as error:
        raise Failure(f"comparisons of cohort {cohort!r} cannot be stored: {error}") from error
    list_files(storage, FOLDER, [file, *beside])
