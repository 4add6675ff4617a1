"""What a verdict is worth, and a crash to watch: ``controls``, ``peer``, ``replay``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from trace_dag.cli.options import ManyValuesCommand, examples, execution_overrides, executor_options
from trace_dag.cli.printing import print_table, write_json
from trace_dag.cli.progress import progress_told

if TYPE_CHECKING:
    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.batch import Pipeline
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.perturbed import Request
    from trace_dag.settings import RuleSetName
    from trace_dag.verdict.controls import ControlRow
    from trace_dag.verdict.peer import ComparisonRow

Found = TypeVar("Found")


rules_option = click.option(
    "--rules",
    type=click.Choice(["trace-dag", "strict", "published"]),
    help="Rules to judge by; default those of the settings.",
)


def _judged_by(home: Home, rules: RuleSetName | None) -> Pipeline:
    return home.pipeline({"verdict": {"rule_set": rules}} if rules else None)


def _home(root: str) -> Home:
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.stages import FLOW

    return Home(root, FLOW)


def _cohorts(home: Home, cohort: str | None) -> list[str]:
    from trace_dag.errors import UserError

    registry = home.pipeline().registry
    if cohort is not None:
        return [registry.cohort(cohort).name]
    names = list(registry.cohorts())
    if not names:
        raise UserError(f"no crash is registered in {home.root}; see trace-dag ingest")
    return names


def _of_each(cohorts: Sequence[str], compared: Callable[[str], Found], complaints: Complaints) -> dict[str, Found]:
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


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag controls",
        "trace-dag controls --rules strict --json",
        "trace-dag controls --perturbed --most 12 --cohort va-2023",
        "trace-dag controls --perturbed --only 2023-510179 --kinds 'clock*' foreign_site --draws 5",
    ),
)
@click.option("--cohort", help="Only this cohort; else each by itself.")
@rules_option
@click.option(
    "--most",
    type=click.IntRange(min=1),
    help="Of a larger cohort, so many crashes drawn at random; default 500, and 12 with --perturbed.",
)
@click.option("--json", "as_json", is_flag=True, help="Every judgement, as JSON.")
@click.option("--perturbed", is_flag=True, help="Change one thing of each report and run all stages again.")
@click.option("--only", metavar="KEY", multiple=True, help="With --perturbed: only these crashes.")
@click.option("--kinds", metavar="NAME", multiple=True, help="With --perturbed: only these changes; * and ? match.")
@click.option("--draws", default=1, show_default=True, type=click.IntRange(min=1), help="Of each change that is drawn.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Of what --perturbed draws.")
@executor_options
@click.pass_obj
def controls(
    root: str,
    cohort: str | None,
    rules: RuleSetName | None,
    most: int | None,
    as_json: bool,
    perturbed: bool,
    only: tuple[str, ...],
    kinds: tuple[str, ...],
    draws: int,
    seed: int,
    executor: str | None,
    workers: int | None,
) -> None:
    """Judge crashes against what they are not: another crash's report, and one vehicle late.

    Prints how many are accepted beside the true pairing's rate; and how many of them with every reported speed driven
    as well, which the paper's criteria do not ask for. Every judgement enters the warehouse, as table
    negative_controls.

    With --perturbed: verified crashes, each with one thing of its report changed, through all stages again. Prints
    for each change how many are still verified, how many corroborated, and how many of the unchanged simulations the
    changed report accepts (own). Every changed report enters the warehouse, as table perturbed_controls.
    """
    from dataclasses import asdict

    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.comparisons import negative_controls
    from trace_dag.warehouse.build import build_warehouse

    home = _home(root)
    complaints = Complaints()
    if perturbed:
        from trace_dag.pipeline.perturbed import MOST, Request

        request = Request(most or MOST, only, kinds, draws, seed)
        _perturbed(home, cohort, rules, request, as_json, execution_overrides(executor, workers), complaints)
        sys.exit(complaints.told())
    if only or kinds:
        raise click.UsageError("--only and --kinds go with --perturbed")
    pipeline = _judged_by(home, rules)
    most = _MOST_CONTROLS if most is None else most
    with progress_told("read, then judged") as tell:
        found = _of_each(
            _cohorts(home, cohort),
            lambda name: negative_controls(pipeline, name, most=most, tell=tell, complain=complaints.hear),
            complaints,
        )
    build_warehouse(pipeline.storage, home.local_folder, complain=complaints.hear)
    if as_json:
        write_json([{"cohort": name, **asdict(row)} for name, rows in found.items() for row in rows])
        sys.exit(complaints.told())
    print_table(
        ["cohort", "judged against", "judgements", "accepted", "rate", "speeds kept too"],
        [line for name, rows in found.items() for line in _control_lines(name, rows)],
    )
    sys.exit(complaints.told())


_MOST_CONTROLS = 500


def _perturbed(
    home: Home,
    cohort: str | None,
    rules: RuleSetName | None,
    request: Request,
    as_json: bool,
    execution: dict[str, Any],
    complaints: Complaints,
) -> None:
    from dataclasses import asdict

    from trace_dag.cli.perturbing import print_perturbed
    from trace_dag.pipeline.perturbed import perturbed_controls
    from trace_dag.warehouse.build import build_warehouse

    overrides: dict[str, Any] = {"execution": execution}
    pipeline = home.pipeline(overrides | ({"verdict": {"rule_set": rules}} if rules else {}))
    with progress_told("changed reports") as tell:
        found = _of_each(
            _cohorts(home, cohort),
            lambda name: perturbed_controls(pipeline, name, request, tell=tell, complain=complaints.hear),
            complaints,
        )
    build_warehouse(pipeline.storage, home.local_folder, complain=complaints.hear)
    if as_json:
        write_json([{"cohort": name, **asdict(row)} for name, rows in found.items() for row in rows])
        return
    for name, rows in found.items():
        click.echo(f"cohort {name}, {len({row.key for row in rows})} verified crashes, seed {request.seed}")
        print_perturbed(rows)


def _control_lines(cohort: str, rows: Sequence[ControlRow]) -> list[tuple[Any, ...]]:
    differ = [row for row in rows if row.kind == "other_report" and row.reports_differ]
    groups = (
        ("its own report", [row for row in rows if row.kind == "true"]),
        ("another crash's report", [row for row in rows if row.kind == "other_report"]),
        ("another that says something else", differ),
        ("its own, one vehicle late", [row for row in rows if row.kind == "shifted"]),
    )
    lines = []
    for title, group in groups:
        judged = [row for row in group if row.accepted is not None]
        accepted = [row for row in judged if row.accepted]
        kept = [row for row in accepted if row.speeds_kept is not False]
        rates = [f"{100 * len(part) / len(judged):.1f} %" if judged else "" for part in (accepted, kept)]
        lines.append((cohort, title, len(judged), len(accepted), *rates))
    return lines


@click.command(
    epilog=examples(
        "trace-dag peer published/ --cohort virginia",
    )
)
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--cohort", help="The cohort that holds the same cases; else each by itself.")
@rules_option
@click.option("--json", "as_json", is_flag=True, help="Every crash of both, as JSON.")
@click.pass_obj
def peer(root: str, folder: Path, cohort: str | None, rules: RuleSetName | None, as_json: bool) -> None:
    """Run a published benchmark's scenarios on its own maps, judged by the same rules, beside ours.

    FOLDER holds simulations/ and maps/. Every judgement enters the warehouse, as table benchmark_comparison. Cases in
    whose report no two vehicles touch are left out of both and named.
    """
    from dataclasses import asdict

    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.comparisons import published_comparison
    from trace_dag.warehouse.build import build_warehouse

    home, complaints = _home(root), Complaints()
    compared = _of_each(
        _cohorts(home, cohort),
        lambda name: published_comparison(_judged_by(home, rules), name, folder, complain=complaints.hear),
        complaints,
    ).values()
    found = [row for each in compared for row in each.rows]
    left_out = {key: why for each in compared for key, why in each.left_out.items()}
    build_warehouse(home.pipeline().storage, home.local_folder, complain=complaints.hear)
    if left_out:
        click.echo(f"{len(left_out)} left out of both, no collision of two vehicles by their reports:", err=True)
        for key, why in left_out.items():
            click.echo(f"  {key}  {why}", err=True)
    if as_json:
        write_json([asdict(row) for row in found])
        sys.exit(complaints.told())
    names = sorted({row.benchmark for row in found})
    columns = [_peer_column([row for row in found if row.benchmark == name]) for name in names]
    print_table(["", *names], [(title, *(column[title] for column in columns)) for title in columns[0]])
    sys.exit(complaints.told())


def _peer_column(rows: Sequence[ComparisonRow]) -> dict[str, str]:
    def share(good: Sequence[bool | None]) -> str:
        known = [each for each in good if each is not None]
        return f"{sum(known)} of {len(known)}"

    return {
        "crashes": str(len(rows)),
        "contact": share([row.contact for row in rows]),
        "first contact within the threshold": share([row.within_distance for row in rows]),
        "impacts as reported": share([bool(row.clocks_ok) for row in rows]),
        "both": share([row.within_distance and bool(row.clocks_ok) for row in rows]),
        "both speeds kept, where both are reported": share([row.speeds_kept for row in rows]),
        "accepted": share([row.accepted for row in rows]),
    }


@click.command(
    epilog=examples(
        "trace-dag replay 2023-510179",
        "trace-dag replay 2023-510179 --agent idm --ego struck --format webp",
    )
)
@click.argument("key")
@click.option(
    "--format",
    "replay_format",
    type=click.Choice(["html", "webp", "gif", "mp4"]),
    default="html",
    show_default=True,
    help="A page with a time slider, an animated picture, or a video (the extra mp4).",
)
@click.option("--agent", metavar="NAME", help="With an agent at one of the wheels: a name, or module:Class.")
@click.option(
    "--ego",
    type=click.Choice(["first", "second", "striking", "struck"]),
    default="first",
    show_default=True,
    help="Whose place the agent takes.",
)
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), help="Where to; else ./replay-KEY.FORMAT.")
@click.pass_obj
def replay(
    root: str,
    key: str,
    replay_format: Literal["html", "gif", "webp", "mp4"],
    agent: str | None,
    ego: str,
    output: Path | None,
) -> None:
    """Write a simulated crash to watch, seen from above: roads, vehicles, paths, contact and speeds."""
    from trace_dag.pipeline.comparisons import replay as made_of
    from trace_dag.pipeline.evaluations import Role, replay_with

    pipeline = _home(root).pipeline()
    if agent is None:
        content = made_of(pipeline, key, replay_format)
    else:
        sys.path.insert(0, str(Path.cwd()))  # where the module of an agent under development is
        content = replay_with(pipeline, key, agent, Role(ego), replay_format)
    target = output or Path(f"replay-{key}.{replay_format}")
    target.write_bytes(content)
    click.echo(f"{target}  {len(content) // 1024} kB")
