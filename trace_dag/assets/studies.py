"""Studies as assets: questions over stored crashes, asked from the UI, with their tables to look at.

Each is unpartitioned and has the options of its command as configuration. After its run the warehouse is brought up to
date, as after runs of stages (:mod:`trace_dag.assets.automation`).
"""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import partial, wraps
from pathlib import Path
from typing import Any, TypeVar

from dagster import AssetExecutionContext, AssetsDefinition, Config, Failure, MaterializeResult, MetadataValue, asset
from pydantic import Field

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.observation import Sensing
from trace_dag.agents.evaluation.registry import BASELINES
from trace_dag.agents.evaluation.shares import data_url, share_chart
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.evaluations import evaluate_agents, try_agents
from trace_dag.agents.families import make_families
from trace_dag.agents.stored_cases import AgentRole, StoredCase, likely_courses, stored_variations, verified_cases
from trace_dag.agents.stored_traffic import make_traffic
from trace_dag.agents.stored_variations import FamilyRequest
from trace_dag.agents.summaries import StudyTable, controls_table, evaluations_table, families_table, traffic_table
from trace_dag.assets.specs import OWNERS
from trace_dag.common.errors import Failure as BrokenPart
from trace_dag.common.errors import UserError
from trace_dag.common.messages import markdown
from trace_dag.common.messages.wording import count_of, last_line
from trace_dag.common.stage import Stage
from trace_dag.export.release import build_release
from trace_dag.flow.controls import negative_controls
from trace_dag.flow.stored_crashes import cohorts_of, study_each
from trace_dag.flow.workspace import Workspace
from trace_dag.scenario.traffic.simulation import TrafficRequest

GROUP = "studies"
Kind = TypeVar("Kind", bound=StrEnum)
_BARS = 40  # of a picture at the most
_LEFT_OUT = "left_out"  # metadata: a sentence for each crash that could not take part


class CohortConfig(Config):
    """The choice of crashes."""

    cohort: str = Field(default="", description="Only this cohort; empty: each by itself.")


class ControlsConfig(CohortConfig):
    """Options of negative controls."""

    most: int = Field(default=500, ge=1, description="Of a larger cohort, so many crashes drawn at random.")


class EvaluationsConfig(CohortConfig):
    """Options of evaluations."""

    agents: list[str] = Field(default=list(BASELINES), description="Names, or module:Class.")
    ego: list[str] = Field(default=["first", "second"], description="Whose place: first, second, striking, struck.")
    variations: bool = Field(default=False, description="In the stored variations instead of the crashes.")
    courses: bool = Field(default=False, description="In the likely courses of the crashes instead of one each.")
    rate_hz: float = Field(default=20.0, description="How often they act.")
    range_m: float = Field(default=150.0, description="How far they see.")
    noise_m: float = Field(default=0.0, description="Standard deviation of the positions they see.")
    occlusion: bool = Field(default=False, description="They do not see whom another body hides.")
    seed: int = Field(default=1, description="Of the noise.")
    traffic: str = Field(
        default="recorded", description="How others move: recorded, reactive, persistent, surrounding."
    )


class VariationsConfig(CohortConfig):
    """Options of variations."""

    count: int = Field(default=10, ge=1, description="Variations of each crash.")
    seed: int = Field(default=1, description="The same crash and seed give the same variations.")


class TrafficConfig(CohortConfig):
    """Options of traffic."""

    factor: float = Field(default=1.0, ge=0, le=10, description="Multiple of the usual volumes.")
    seed: int = Field(default=1, description="The same crash, factor and seed give the same traffic.")


class ReleaseConfig(CohortConfig):
    """Options of a release."""

    version: str = Field(default="", description="Such as 1.0.")
    output: str = Field(default="releases", description="The folder that the release is written into.")


class _LeftOut(list[str]):
    """Crashes that a study left out, a sentence each."""

    def add(self, failure: Exception) -> None:
        """Note why something is left out."""
        self.append(str(failure))


def _one_of(kind: type[Kind], value: str) -> Kind:
    """Return ``value`` as a member of ``kind``.

    Raises UserError for any other value.
    """
    try:
        return kind(value)
    except ValueError as error:
        raise UserError(f"{value!r}: expected one of {', '.join(kind)}") from error


def _study(description: str, deps: Sequence[str] = (Stage.VERDICT.value,)) -> Callable[[Any], AssetsDefinition]:
    """Make a study an asset. Errors that a retry cannot repair fail its run with their message.

    A study run without options, as by *Materialize all*, is skipped if it lacks its input, and shows that message in
    place of its table. Dagster would count an asset that a successful run left out among the failures of a backfill.
    """

    def as_asset(study: Callable[[AssetExecutionContext, Any], MaterializeResult[Any]]) -> AssetsDefinition:
        @wraps(study)
        def run(context: AssetExecutionContext, config: Config) -> MaterializeResult[Any]:
            try:
                return study(context, config)
            except (UserError, BrokenPart) as error:
                if isinstance(error, UserError) and config == type(config)():
                    return MaterializeResult(metadata={"skipped": str(error)})
                raise Failure(str(error), allow_retries=False) from error

        return asset(
            deps=list(deps),
            group_name=GROUP,
            kinds={"duckdb"},
            owners=OWNERS,
            required_resource_keys={"workspace"},
            description=description,
        )(run)

    return as_asset


def _cases(workspace: Workspace, cohort: str, left_out: _LeftOut) -> list[StoredCase]:
    return verified_cases(workspace, cohort or None, (), on_problem=left_out.add)


def _result(table: StudyTable, left_out: Sequence[str] = (), **figures: Any) -> MaterializeResult[Any]:
    metadata: dict[str, Any] = {
        "table": MetadataValue.md(markdown.table(table.names, table.rows)),
        "dagster/row_count": len(table.rows),
        **figures,
    }
    if table.shares:
        chart = share_chart(table.of_what, table.shares[:_BARS])
        metadata["picture"] = MetadataValue.md(f"![{table.of_what}]({data_url(chart)})")
    if left_out:
        metadata[_LEFT_OUT] = MetadataValue.json(list(left_out))
    return MaterializeResult(metadata=metadata)


@_study("Verdicts against other crashes' reports and with one vehicle late: what an accepted crash is worth.")
def controls(context: AssetExecutionContext, config: ControlsConfig) -> MaterializeResult[Any]:
    """Run ``trace-dag controls``."""
    workspace: Workspace = context.resources.workspace
    left_out = _LeftOut()
    study = partial(negative_controls, workspace, most=config.most, on_problem=left_out.add)
    found = study_each(cohorts_of(workspace, config.cohort or None), study)
    return _result(controls_table(found), left_out)


@_study("Families of the verified crashes: perturbed, simulated, kept where they are still a conflict.")
def variations(context: AssetExecutionContext, config: VariationsConfig) -> MaterializeResult[Any]:
    """Run ``trace-dag vary``."""
    workspace: Workspace = context.resources.workspace
    left_out = _LeftOut()
    cases = _cases(workspace, config.cohort, left_out)
    reports = make_families(workspace, cases, FamilyRequest(config.count, config.seed))
    left_out += [f"{each.key}: {last_line(each.error)}" for each in reports if each.error]
    return _result(families_table(reports), left_out)


@_study("Traffic around the verified crashes, by SUMO: usual for hour, day, area and roads.")
def traffic(context: AssetExecutionContext, config: TrafficConfig) -> MaterializeResult[Any]:
    """Run ``trace-dag traffic``."""
    workspace: Workspace = context.resources.workspace
    left_out = _LeftOut()
    cases = verified_cases(workspace, config.cohort or None, (), departures=None, on_problem=left_out.add)
    reports = make_traffic(workspace, cases, TrafficRequest(config.factor, config.seed))
    left_out += [f"{each.key}: {last_line(each.error)}" for each in reports if each.error]
    return _result(traffic_table(reports), left_out)


@_study("Agents in the place of a crash's drivers.", deps=[Stage.VERDICT.value, "variations"])
def evaluations(context: AssetExecutionContext, config: EvaluationsConfig) -> MaterializeResult[Any]:
    """Run ``trace-dag evaluate``."""
    workspace: Workspace = context.resources.workspace
    left_out = _LeftOut()
    if config.variations and config.courses:
        raise UserError("courses are of crashes, not of variations; choose one of them")
    cases = _cases(workspace, config.cohort, left_out)
    if config.variations:
        cases = stored_variations(workspace, cases, on_problem=left_out.add)
    if config.courses:
        cases = likely_courses(cases)
    limits = AgentLimits()
    try_agents(config.agents, limits)
    rows = evaluate_agents(
        workspace,
        cases,
        config.agents,
        [_one_of(AgentRole, role) for role in config.ego],
        Conditions(
            config.rate_hz,
            Sensing(config.range_m, config.noise_m, config.occlusion),
            config.seed,
            _one_of(Traffic, config.traffic),
        ),
        limits,
        on_problem=left_out.add,
    )
    return _result(evaluations_table(rows, lambda row: row["outcome"], "outcome"), left_out)


@_study("A version of the benchmark to publish.", deps=["benchmark"])
def release(context: AssetExecutionContext, config: ReleaseConfig) -> MaterializeResult[Any]:
    """Run ``trace-dag release``."""
    workspace: Workspace = context.resources.workspace
    left_out = _LeftOut()
    made = build_release(
        workspace, config.version, Path(config.output), cohort=config.cohort or None, on_problem=left_out.add
    )
    if made.missing:
        raise Failure(
            f"{made.folder} is not finished, for it lacks {count_of(made.missing, 'crash', 'crashes')}: "
            + "; ".join(left_out[:10])
        )
    table = StudyTable(["folder", "packages", "files written"], [(str(made.folder), made.packages, made.written)])
    return _result(table, left_out, folder=MetadataValue.path(str(made.folder)))


STUDIES: Mapping[str, AssetsDefinition] = {
    each.key.to_user_string(): each for each in (controls, variations, traffic, evaluations, release)
}
