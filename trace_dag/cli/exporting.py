"""Taking verified crashes elsewhere: ``export`` and ``release``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import ManyValuesCommand, examples
from trace_dag.cli.progress import progress_of, progress_told

if TYPE_CHECKING:
    from trace_dag.pipeline.exporting import Layout
    from trace_dag.scenario.release import ArchiveFormat


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag export --output packages/",
        "trace-dag export --layout published --only 2023-510179",
    ),
)
@click.option(
    "--layout",
    type=click.Choice(["packages", "published"]),
    default="packages",
    show_default=True,
    help="A scenario package per crash, as a folder; or the published benchmark's layout, for scripts written for it.",
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), help="Where to; else ./LAYOUT.")
@click.pass_obj
def export(root: str, layout: Layout, cohort: str | None, only: tuple[str, ...], output: Path | None) -> None:
    """Write the verified crashes out, for use without this program.

    Exported again, only what has changed is written.
    """
    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.exporting import export as write
    from trace_dag.pipeline.exporting import verified_keys
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.stages import FLOW

    pipeline, folder = Home(root, FLOW).pipeline(), output or Path(layout)
    complaints, exported = Complaints(), 0
    keys = verified_keys(pipeline, cohort, only, complain=complaints.hear)
    with progress_of("crashes", len(keys)) as told:

        def tell(key: str) -> None:
            nonlocal exported
            exported += 1
            told(key)

        written = write(pipeline, keys, folder, layout, told=tell, complain=complaints.hear)
    click.echo(f"{folder}  {exported} crashes, {written} files written")
    sys.exit(complaints.told())


@click.command(
    epilog=examples(
        "trace-dag release --version 1.0",
        "trace-dag release --version 1.1 --cohort virginia --archive zip",
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
@click.pass_obj
def release(root: str, version: str, cohort: str | None, output: Path, archive: ArchiveFormat | None) -> None:
    """Release the verified crashes as a version of the benchmark: packages, index, datasheet, checksums.

    An interrupted release goes on where it stopped. A finished one is never changed: other content needs another
    version.
    """
    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.exporting import verified_keys
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.releasing import build_release, check_version
    from trace_dag.pipeline.stages import FLOW
    from trace_dag.warehouse.build import build_warehouse

    check_version(version)
    home = Home(root, FLOW)
    pipeline, complaints = home.pipeline(), Complaints()
    verified_keys(pipeline, cohort, complain=complaints.hear)  # says so if there is none to release
    built = build_warehouse(pipeline.storage, home.local_folder, complain=complaints.hear)
    with progress_told("pages, then packages") as tell:
        made = build_release(
            pipeline,
            home.warehouse,
            version,
            output,
            cohort=cohort,
            archive=archive,
            unknown=built.incomplete_crashes,
            tell=tell,
            complain=complaints.hear,
        )
    if made.missing:
        click.echo(f"{made.folder}  {made.packages} packages; not finished, {made.missing} crashes are missing:")
        complaints.told()
        click.echo("Mend them and release again; what is there is kept.")
        sys.exit(1)
    state = f"{made.written} files written" if made.written else "up to date"
    click.echo(f"{made.folder}  {made.packages} packages, {state}")
    click.echo("Where to look:")
    click.echo(f"  {made.folder}/README.md  what it is")
    click.echo(f"  {made.folder}/DATASHEET.md  where it comes from, with counts, and its limits")
    click.echo(f"  {made.folder}/index.parquet  a row per package; index.json the same")
    if made.archive:
        click.echo(f"  {made.archive}  {made.archive.stat().st_size // 1_000_000} MB, all of it in one file")
    sys.exit(complaints.told())
