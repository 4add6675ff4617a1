"""Agreement of storage, Dagster and the warehouse: ``verify``."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import one_line, print_first, print_stale, progress_bar, say, write_json
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.messages.wording import count_of

if TYPE_CHECKING:
    from trace_dag.flow.batch import StaleResult
    from trace_dag.flow.verify import Disagreement, StorageReport
    from trace_dag.flow.workspace import Workspace

_SHOWN = 50


@click.command(epilog=examples("trace-dag verify", "trace-dag verify --contents --repair"))
@click.option("--repair", is_flag=True, help="Mend what can be, then look again.")
@click.option("--contents", is_flag=True, help="Read every file and compare its SHA-256, not only its size.")
@click.option("--json", "as_json", is_flag=True, help="Every disagreement, as JSON.")
@pass_root
def verify(root: str, repair: bool, contents: bool, as_json: bool) -> None:
    """Check that the stored files, Dagster's records and the warehouse agree, or list the disagreements.

    Run it while no other command works on the root: an unfinished write looks like a disagreement. The exit code is 0
    if everything agrees, and 1 otherwise (with --repair, 1 if something is left, such as stages to run again). Results
    older than their code, settings or inputs are listed too; they are not errors.
    """
    from trace_dag.assets.launch import dagster_records, summarise
    from trace_dag.assets.verify import repair_dagster
    from trace_dag.common.stage import Stage
    from trace_dag.export.build import repair_benchmark
    from trace_dag.flow.verify import DisagreementKind, Quarantine, repair_storage
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.build import is_outdated

    workspace = Workspace.open(root, to_read=not repair)
    storage = workspace.storage
    if not any(map(storage.list, ("cohorts", *Stage))):  # as where a disk is not mounted
        raise UserError(f"verify: {storage.root} holds no cohort and no result; see that its disk is mounted")
    with dagster_records(workspace) as instance:
        report, found = _look(storage, workspace, instance, contents)
        before = found
        if repair and found:
            with Quarantine(storage) as aside:
                repair_storage(storage, found, aside)
                repair_benchmark(found, aside)
            report, found = _look(storage, workspace, instance)
            with progress_bar("records in Dagster") as on_progress:
                repair_dagster(instance, storage, report.records, found, on_progress)
            made_together = (
                DisagreementKind.WAREHOUSE,
                DisagreementKind.DAMAGED_PAGE,
                DisagreementKind.DAMAGED_RESULT,
                DisagreementKind.LOST_COHORT,
                DisagreementKind.LOST_REGISTRY,
                DisagreementKind.UNLISTED_FILE,
            )
            if any(each.kind in made_together for each in (*before, *found)):
                for error in summarise(workspace, instance).errors:
                    print_problem(f"failed: {one_line(error, 500)}")
            report, found = _look(storage, workspace, instance)
    stale = _stale(workspace, report)
    left = set(found)
    mended = [each for each in before if each not in left]
    if as_json:
        by_stage = Counter(each.stage.value for each in stale)
        write_json(
            {
                **_figures(report),
                "stale": by_stage,
                "repaired": list(map(_row, mended)),
                "disagreements": list(map(_row, found)),
            }
        )
    else:
        _print("repaired", mended)
        _print("disagreement", found)
        if stale:
            print_stale(stale)
            say()
        outdated = report.older or is_outdated(workspace.warehouse)
        say(_summary(report, found, repair, outdated))
    sys.exit(1 if found else 0)


def _look(
    storage: Any, workspace: Workspace, instance: Any, contents: bool = False
) -> tuple[StorageReport, list[Disagreement]]:
    from trace_dag.assets.verify import verify_dagster
    from trace_dag.export.build import verify_benchmark
    from trace_dag.flow.verify import DisagreementKind, verify_storage
    from trace_dag.warehouse.verify import verify_warehouse

    with progress_bar("artefacts") as on_progress:
        report = verify_storage(storage, workspace.local_folder, contents=contents, progress=on_progress)
    found = [*report.disagreements]
    lost = any(each.kind in (DisagreementKind.LOST_COHORT, DisagreementKind.LOST_REGISTRY) for each in found)
    if not report.older:
        found += verify_benchmark(storage, contents=contents)
    if not report.older and not lost:  # else every crash would be too much for both
        found += verify_dagster(instance, report.records)
        found += verify_warehouse(workspace.warehouse, report.records)
    return report, found


def _stale(workspace: Workspace, report: StorageReport) -> list[StaleResult]:
    """Return the outdated results, which a run would make again, without the damaged ones."""
    from trace_dag.flow.batch import stale_results

    try:
        stale = stale_results(workspace, report.records)
    except DamagedFile:
        return []  # of the registry, which is listed
    damaged = {(each.key, each.stage) for each in report.disagreements}
    return [each for each in stale if (each.key, each.stage) not in damaged]


def _figures(report: StorageReport) -> dict[str, int]:
    return {
        "crashes": len(report.records),
        "records": sum(map(len, report.records.values())),
        "files": report.files,
        "interrupted": report.interrupted,
        "unregistered": report.unregistered,
    }


def _row(each: Disagreement) -> dict[str, str | None]:
    return {
        "disagreement": each.kind.title,
        "key": each.key,
        "stage": each.stage.value if each.stage else None,
        "file": each.file,
        "detail": each.detail,
        "remedy": each.kind.remedy,
    }


def _print(title: str, rows: Sequence[Disagreement]) -> None:
    if not rows:
        return
    found = [(each.kind.title, each.key, each.stage, each.detail, each.kind.remedy) for each in rows]
    print_first([title, "crash", "stage", "what", "remedy"], found, _SHOWN, "--json")
    say()


def _summary(report: StorageReport, found: Sequence[Disagreement], repaired: bool, outdated: bool) -> str:
    figures = _figures(report)
    counted = count_of(figures["crashes"], "crash", "crashes"), count_of(figures["records"], "stage outcome")
    lines = [", ".join((*counted, count_of(figures["files"], "file")))]
    if figures["interrupted"]:
        lines.append(f"interrupted: {count_of(figures['interrupted'], 'stage')}; trace-dag run finishes what was begun")
    if figures["unregistered"]:
        lines.append(f"kept, though registered no more: {count_of(figures['unregistered'], 'crash', 'crashes')}")
    if outdated:
        lines.append(
            "made by an earlier version of the program; trace-dag run brings it up to date and keeps its reports"
        )
    if found:
        counts = Counter(each.kind.title for each in found)
        named = ", ".join(f"{count} {title}" for title, count in counts.most_common())
        lines.append(
            f"{count_of(len(found), 'disagreement')}: {named}" + ("" if repaired else "; --repair mends what can be")
        )
    elif not outdated:
        lines.append("storage, Dagster and the warehouse agree")
    return ": ".join((lines[0], "; ".join(lines[1:])))
