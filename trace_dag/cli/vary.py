"""Families of crashes for tests: ``vary``."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path

import click

from trace_dag.cli.options import ManyValuesCommand, Within, examples, pass_root
from trace_dag.cli.printing import print_table, progress_of, write_json
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.errors import Failure
from trace_dag.common.messages.wording import last_line
from trace_dag.common.storage.disk_errors import name_file_in_errors

_SHARE, _SECONDS, _METRES = Within(0, 1, max_open=True), Within(0, 60), Within(0, 50)


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag vary --count 20",
        "trace-dag vary --only 2023-510179 --speed 0.1 --collisions-only --output families/",
    ),
)
@click.option("--count", type=click.IntRange(1, 999), default=10, show_default=True, help="Variations of each crash.")
@click.option("--seed", default=1, show_default=True, help="The same crash, seed and bounds give the same variations.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes.")
@click.option("--speed", "speed_rel", type=_SHARE, default=0.15, show_default=True, help="Speeds, share more or less.")
@click.option("--timing", "timing_s", type=_SECONDS, default=0.4, show_default=True, help="Earlier or later, s.")
@click.option("--lateral", "lateral_m", type=_METRES, default=0.4, show_default=True, help="To the left or right, m.")
@click.option(
    "--friction",
    "friction_low",
    type=Within(min=0, max=1, min_open=True),
    default=0.6,
    show_default=True,
    help="Least friction, share of the crash's.",
)
@click.option(
    "--reaction",
    "reaction_s",
    type=_SECONDS,
    default=1.2,
    show_default=True,
    help="Longest braking before the impact, s.",
)
@click.option("--collisions-only", is_flag=True, help="Keep no near misses.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), help="Write a package of each there, too.")
@click.option("--json", "as_json", is_flag=True, help="What came of each crash, as JSON.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")
@pass_root
def vary(
    root: str,
    count: int,
    seed: int,
    cohort: str | None,
    only: tuple[str, ...],
    speed_rel: float,
    timing_s: float,
    lateral_m: float,
    friction_low: float,
    reaction_s: float,
    collisions_only: bool,
    output: Path | None,
    as_json: bool,
    workers: int | None,
) -> None:
    """Make a family of each verified crash: perturbed, simulated, kept if it is drivable and still a conflict.

    A variation is kept if the two parties still collide within 15 m of the original contact, or miss each other by a
    metre at most, and all stay on the road. trace-dag evaluate --variations drives in the variations. They enter the
    warehouse as table variations.
    """
    from trace_dag.agents.families import make_families
    from trace_dag.agents.stored_cases import stored_variations, verified_cases
    from trace_dag.agents.stored_variations import FamilyRequest
    from trace_dag.agents.summaries import families_table
    from trace_dag.agents.variations import Bounds, Criteria
    from trace_dag.export.package import zip_files
    from trace_dag.export.packaging import package_of_variation
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, overrides={"execution": {"workers": workers} if workers else {}})
    problems = Problems()
    cases = verified_cases(workspace, cohort, only, on_problem=problems.add)
    request = FamilyRequest(
        count,
        seed,
        Bounds(speed_rel, timing_s, lateral_m, friction_low, reaction_s),
        Criteria(near_miss_m=-1.0 if collisions_only else Criteria.near_miss_m),
    )
    with progress_of("families", len(cases)) as on_progress:
        reports = make_families(workspace, cases, request, on_progress=lambda report: on_progress(report.key))
    into_warehouse(workspace, problems)
    kept = sum(report.kept for report in reports)
    if as_json:
        write_json([asdict(report) for report in reports])
    else:
        print_table(*families_table(reports)[:2])
    for report in reports:
        if report.error:
            problems.add(Failure(f"{report.key}: {last_line(report.error)}"))
    if output is not None and kept:
        output.mkdir(parents=True, exist_ok=True)
        stored = stored_variations(workspace, cases, on_problem=problems.add)
        with progress_of("packages", len(stored)) as on_progress:
            for case in stored:
                try:
                    archive = zip_files(package_of_variation(case), folder=case.case_id)
                    with name_file_in_errors(target := output / f"{case.case_id}.zip"):
                        target.write_bytes(archive)
                except Failure as failure:
                    problems.add(failure)
                on_progress(case.case_id)
    sys.exit(problems.print_all())
