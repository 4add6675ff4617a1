"""A version of the benchmark to publish: ``release``."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import progress_bar, say
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.messages.wording import count_of

if TYPE_CHECKING:
    from trace_dag.export.release_files import ArchiveFormat


@click.command(
    epilog=examples(
        "trace-dag release --version 1.0",
        "trace-dag release --version 1.1 --cohort virginia --archive zip",
        "trace-dag release --version 1.1 --bench trace-bench.json --national FARS2015-accident.zip",
    )
)
@click.option("--version", required=True, help="Version of the release, such as 1.0.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("releases"),
    show_default=True,
    help="Where the release's folder is put.",
)
@click.option("--archive", type=click.Choice(["tar", "zip"]), help="Also as one file beside the folder.")
@click.option(
    "--bench",
    type=click.Path(dir_okay=False, path_type=Path),
    help="A trace-bench.json of others: release its crashes, to the same bytes, or say which input differs.",
)
@click.option(
    "--national",
    multiple=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="FARS's accident table of a whole year (CSV or ZIP): weigh the crashes to the country's.",
)
@pass_root
def release(
    root: str,
    version: str,
    cohort: str | None,
    output: Path,
    archive: ArchiveFormat | None,
    bench: Path | None,
    national: tuple[Path, ...],
) -> None:
    """Release the verified crashes as a version of the benchmark: packages, index, datasheet, checksums.

    An interrupted release resumes. A finished one is never changed: other content needs another version.
    """
    from trace_dag.export.export import accepted_keys
    from trace_dag.export.release import build_release, check_version
    from trace_dag.flow.workspace import Workspace

    check_version(version)
    workspace, problems = Workspace.open(root), Problems()
    accepted_keys(workspace, cohort, on_problem=problems.add)  # says so if there is none to release
    built = into_warehouse(workspace, problems)
    with progress_bar("pages, then packages") as on_progress:
        made = build_release(
            replace(workspace, page_listener=on_progress),
            version,
            output,
            cohort=cohort,
            archive=archive,
            bench=bench,
            national=national,
            unknown=built.incomplete_crashes,
            on_problem=problems.add,
        )
    if made.missing:
        say(
            f"{made.folder}  {count_of(made.packages, 'package')}; not finished, "
            f"missing: {count_of(made.missing, 'crash', 'crashes')}"
        )
        problems.print_all()
        say("Mend them and release again; what is there is kept.")
        sys.exit(1)
    state = f"{count_of(made.written, 'file')} written" if made.written else "up to date"
    say(f"{made.folder}  {count_of(made.packages, 'package')}, {state}")
    say("Where to look:")
    say(f"  {made.folder}/README.md  summary")
    say(f"  {made.folder}/DATASHEET.md  its sources, with counts, and its limits")
    say(f"  {made.folder}/trace-bench.json  its definition: release --bench makes it again")
    say(f"  {made.folder}/index.parquet  a row per package; index.json the same")
    if made.archive:
        say(f"  {made.archive}  {made.archive.stat().st_size // 1_000_000} MB, the whole release in one file")
    sys.exit(problems.print_all())
