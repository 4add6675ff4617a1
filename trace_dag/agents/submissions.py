"""Results of agents as a file that others can hand in, and the checks before it enters the leaderboard.

A file is JSON with a checksum: every run of one part of the benchmark under the conditions of its protocol. Belongs
here: the content of such a file, and the checks that it fits the crashes of a root. Does not belong here: the identity
of the agent. A checksum is no signature, so every run's drive is judged again; only the agent itself could prove that
it drove.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any, Final

from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.metrics import DriveOutcome, Metrics, measure, outcome_of
from trace_dag.agents.evaluation.registry import BASELINES, label
from trace_dag.agents.evaluation.rejudging import problem_of_drive
from trace_dag.agents.evaluation.splits import Split
from trace_dag.agents.evaluation.table import EVALUATIONS, Row
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.evaluation_work import evaluation_code_version
from trace_dag.agents.evaluations import agents_of
from trace_dag.agents.stored_cases import AgentRole, StoredCase, load_case, number_of, verified_cases
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.schemas import ColumnType
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.flow.records import OnProblem, raise_problem
from trace_dag.flow.workspace import Workspace
from trace_dag.scenario.cases import Case
from trace_dag.version import __version__

_FORMAT: Final = "trace-dag results 2"
_PYTHON: Final[Mapping[ColumnType, tuple[type, ...]]] = {
    ColumnType.TEXT: (str,),
    ColumnType.INTEGER: (int,),
    ColumnType.REAL: (float, int),
    ColumnType.BOOLEAN: (bool,),
}
_SAME_MPS: Final = 1e-3
_SAME_RISK: Final = 1e-4
_AGAIN: Final = "evaluate the agent again on the crashes as they are now"


def results_file(rows: Sequence[Row], split: Split, cohort: str | None) -> bytes:
    """Return the runs of one part, to hand in."""
    document = {
        "format": _FORMAT,
        "made_by": f"trace-dag {__version__}",
        "split": split.value,
        "cohort": cohort,
        "runs": [
            {column.name: row.get(column.name) for column in EVALUATIONS.columns} | {"handed_in": True} for row in rows
        ],
    }
    return add_checksum(json.dumps(document).encode())


def check(
    workspace: Workspace, data: bytes, name: str, *, on_problem: OnProblem = raise_problem
) -> dict[str, list[Row]]:
    """Return the runs of a file by agent.

    Raises :class:`UserError` with the reason if a file is refused.
    """
    split, cohort, by_agent = _read(data, name)
    _check_names(name, by_agent, agents_of(workspace.storage))
    cases = verified_cases(workspace, cohort, (), split=split, on_problem=on_problem)
    code = evaluation_code_version(workspace.settings.sim)
    if not {row["key"] for rows in by_agent.values() for row in rows} & {case.key for case in cases}:
        raise UserError(f"{name}: none of its crashes is among the {len(cases)} of the part {split} of this root")
    for agent, rows in by_agent.items():
        _check_conditions(name, agent, rows, split, code)
    for case in cases:
        _check_case(name, case, by_agent)
    expected = {case.key for case in cases}
    for agent, rows in by_agent.items():
        unknown = sorted({row["key"] for row in rows} - expected)
        if unknown:
            raise UserError(f"{name}: {agent} has runs of {unknown[0]}, which is not in the part {split} of this root")
    return by_agent


def _check_names(name: str, agents: Collection[str], taken: Collection[str]) -> None:
    for agent in agents:
        if agent.partition("-")[0] in BASELINES:
            raise UserError(f"{name}: {agent} is the name of a baseline, which trace-dag evaluate drives here itself")
        if agent != label(agent):
            raise UserError(f"{name}: {agent!r} cannot be the name of an agent; evaluate names it {label(agent)}")
        if agent in taken:
            raise UserError(
                f"{name}: evaluations of {agent} are stored here already; evaluate --remove {agent} deletes them"
            )


def _read(data: bytes, name: str) -> tuple[Split, str | None, dict[str, list[Row]]]:
    try:
        document: dict[str, Any] = check_document(data, name=name)
        if document["format"] != _FORMAT:
            raise UserError(f"{name}: format {document['format']!r}; expected {_FORMAT!r}")
        split, cohort, runs = Split(document["split"]), document["cohort"], document["runs"]
        by_agent: dict[str, list[Row]] = defaultdict(list)
        for run in runs:
            by_agent[_checked_row(run, name)["agent"]].append(run)
    except DamagedFile as damaged:
        raise UserError(
            f"{name}: {damaged.found}; expected a file of evaluate --results as it was written"
        ) from damaged
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        what = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise UserError(f"{name}: not a file of results ({what}); expected one of evaluate --results") from error
    if not by_agent:
        raise UserError(f"{name}: there are no runs in it")
    return split, cohort, dict(by_agent)


def _checked_row(run: Row, name: str) -> Row:
    if set(run) != {column.name for column in EVALUATIONS.columns}:
        raise UserError(f"{name}: a run has other columns than evaluations of this version; {_AGAIN}")
    for column in EVALUATIONS.columns:
        value, kinds = run[column.name], _PYTHON[column.type or ColumnType.TEXT]
        wrong = not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds)
        if (value is None and column.required) or (value is not None and wrong):
            raise UserError(f"{name}: {column.name} of a run is {value!r}; expected {column.type}")
    return run


def _check_conditions(name: str, agent: str, rows: Sequence[Row], split: Split, code: str) -> None:
    usual = Conditions()
    asked = {
        "rate_hz": usual.rate_hz,
        "range_m": usual.sensing.range_m,
        "noise_m": usual.sensing.noise_m,
        "occlusion": usual.sensing.occlusion,
        "seed": usual.seed,
    }
    for row in rows:
        for condition, value in asked.items():
            if row[condition] != value:
                raise UserError(f"{name}: {agent} has {condition} {row[condition]!r}; the protocol has {value!r}")
        if row["traffic"] not in list(Traffic) or row["traffic"] != rows[0]["traffic"]:
            raise UserError(f"{name}: {agent} has traffic {row['traffic']!r}; expected one kind for all runs")
        if row["split"] != split or not row["handed_in"]:
            raise UserError(f"{name}: {agent} has runs that evaluate --split {split} --results did not write")
        if row["code_version"] != code:
            raise UserError(
                f"{name}: stale, its runs were measured by code {row['code_version']}, not {code}; {_AGAIN}"
            )


def _check_case(name: str, stored: StoredCase, by_agent: Mapping[str, Sequence[Row]]) -> None:
    case = load_case(stored)
    recorded = {
        ego: measure(case, ego, case.recorded)
        for ego in {number_of(case, role) for role in (AgentRole.FIRST, AgentRole.SECOND)}
    }
    for agent, rows in by_agent.items():
        runs = [row for row in rows if row["key"] == stored.key]
        where = f"{name}: {agent} in {stored.key}"
        if Counter((row["case_id"], row["vehicle_number"]) for row in runs) != Counter(
            (stored.case_id, ego) for ego in recorded
        ):
            raise UserError(f"{where}: expected one run in the place of each of vehicles {sorted(recorded)}")
        for row in runs:
            if row["verdict_fingerprint"] != stored.fingerprint:
                raise UserError(f"{where}: stale, the crash has been judged again since; {_AGAIN}")
            _check_run(where, row, case, recorded[row["vehicle_number"]])


def _check_run(where: str, row: Row, case: Case, recorded: Metrics) -> None:
    if row["outcome"] not in list(DriveOutcome):
        raise UserError(f"{where}: outcome {row['outcome']!r}; expected {', '.join(DriveOutcome)}")
    if row["outcome"] == DriveOutcome.FAULTY:
        return
    missing = [each.name for each in fields(Metrics) if row[each.name] is None and "None" not in str(each.type)]
    if missing:
        raise UserError(f"{where}: no {missing[0]}, which every run has")
    metrics = Metrics(**{each.name: row[each.name] for each in fields(Metrics)})
    for what, tolerance in (
        ("recorded_delta_v_mps", _SAME_MPS),
        ("recorded_own_delta_v_mps", _SAME_MPS),
        ("recorded_serious_injury_risk", _SAME_RISK),
    ):
        if abs(getattr(metrics, what) - getattr(recorded, what)) > tolerance:
            raise UserError(f"{where}: {what} is {row[what]:g}, but {getattr(recorded, what):g} in the crash itself")
    if metrics.collided != (metrics.contact_time_s is not None):
        raise UserError(f"{where}: collided is {metrics.collided}, but its contact time is {metrics.contact_time_s}")
    if outcome_of(metrics) != row["outcome"]:
        raise UserError(f"{where}: outcome {row['outcome']}, but its measures say {outcome_of(metrics)}")
    problem = problem_of_drive(case, row["vehicle_number"], metrics, Traffic(row["traffic"]), row["drive"] or "")
    if problem:
        raise UserError(f"{where}: {problem}")
