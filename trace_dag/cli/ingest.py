"""Registering crashes: ``ingest``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.ingest_options import choice_of, choice_options
from trace_dag.cli.options import ManyValuesCommand, examples
from trace_dag.cli.printing import say
from trace_dag.cli.progress import progress_bar
from trace_dag.errors import UserError
from trace_dag.messages.wording import counted

if TYPE_CHECKING:
    from trace_dag.cohorts.ingest import IngestReport

_NAMED = 10


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag ingest --reports reports/ --maps virginia.osm.pbf --cohort virginia",
        "trace-dag ingest --fars-csv FARS2023NationalCSV.zip --maps overpass --states VA --sample 100",
    ),
)
@click.option("--reports", multiple=True, metavar="PATH", help="Folders or files of CrashAPI XML reports.")
@click.option("--fars-csv", multiple=True, metavar="PATH", help="FARS national CSV files: folders or zips.")
@click.option(
    "--source",
    nargs=2,
    multiple=True,
    metavar="NAME LOCATION",
    help="Another source of reports that an installed package offers; trace-dag plugins lists them.",
)
@click.option(
    "--crashapi",
    is_flag=True,
    help="Ask NHTSA's CrashAPI for the cases of --states and --years, or for --cases; reports are fetched in the run.",
)
@click.option(
    "--maps",
    multiple=True,
    metavar="PATH",
    help="Folders or files of OpenStreetMap data (.osm, .osm.gz, .osm.bz2, .pbf); "
    "overpass, osm-api or another that a package offers is asked where no file covers a crash.",
)
@click.option("--cohort", default="default", show_default=True, help="Name of the cohort the crashes belong to.")
@choice_options
@click.option(
    "--watch",
    is_flag=True,
    help="Let the UI register what arrives in the folders of --reports or is released by the CrashAPI later.",
)
@click.option("--refresh", is_flag=True, help="Ask the CrashAPI again for what it answered before.")
@click.pass_obj
def ingest(
    root: str,
    /,
    reports: tuple[str, ...],
    fars_csv: tuple[str, ...],
    source: tuple[tuple[str, str], ...],
    crashapi: bool,
    maps: tuple[str, ...],
    cohort: str,
    watch: bool,
    refresh: bool,
    **options: Any,
) -> None:
    """Register crashes and the maps to find their roads in.

    Sources are folders of reports, the national CSV files and the CrashAPI, one or several. Filters and samples choose
    among the crashes they hold; a crash whose source does not say what a filter asks for is not chosen. For filters
    on more than state, year, county name and vehicles, the CrashAPI is asked for every report in question.

    Each crash finds the map that covers it. Ingesting again adds what is new and changes nothing else; maps can be
    added later by themselves.
    """
    from trace_dag.cohorts.ingest import ingest as ingest_into
    from trace_dag.cohorts.services import crash_api
    from trace_dag.flow.workspace import Workspace
    from trace_dag.plugins import PluginKind, offered
    from trace_dag.storage.files import Storage

    if not (reports or maps or fars_csv or source or crashapi):
        raise UserError("ingest: nothing to register; give --reports, --fars-csv, --source, --crashapi or --maps")
    if watch and not (reports or crashapi):
        raise UserError("ingest: --watch needs --reports, the folders to look at, or --crashapi")
    choice = choice_of(options)
    if watch and crashapi and (choice.cases or choice.sample or choice.stratified):
        raise UserError("ingest: --watch follows all that a filter admits; it goes with no sample and no --cases")
    Storage.open(root)
    workspace = Workspace.open(root)
    services = [path for path in maps if path in offered(PluginKind.MAP_SOURCE)]
    if len(services) > 1:
        raise UserError(f"ingest: a cohort asks one service for maps, not {' and '.join(services)}")
    with progress_bar("reports looked up") as on_progress:
        report = ingest_into(
            workspace.storage,
            cohort,
            reports=[Path(path) for path in reports],
            maps=[Path(path) for path in maps if path not in services],
            tables=[*(("fars-csv", path) for path in fars_csv), *source],
            crash_api=crash_api(workspace.settings.services, workspace.storage, refresh=refresh) if crashapi else None,
            choice=choice,
            map_service=services[0] if services else None,
            watch=watch,
            progress=on_progress,
        )
    _add_partitions(root)
    for line in _lines(report, cohort):
        say(line)


def _add_partitions(root: str) -> None:
    from trace_dag.assets.partitions import add_partitions
    from trace_dag.cohorts.registry import Registry
    from trace_dag.definitions.launch import dagster_records
    from trace_dag.flow.workspace import Workspace
    from trace_dag.storage.files import Storage

    with dagster_records(Workspace.open(root)) as instance:
        add_partitions(instance, Registry(Storage(root)).keys())


def _lines(report: IngestReport, cohort: str) -> list[str]:
    done = report.registration
    lines = [
        *report.notes,
        f"Cohort {cohort}: {counted(len(done.added), 'crash', 'crashes')} registered, "
        f"{len(done.known)} known already, {len(done.changed)} with a changed report; "
        f"{counted(report.maps, 'map file')}, {done.maps_added} of them new.",
    ]
    registered = len(done.added) + len(done.known) + len(done.changed) + len(done.elsewhere)
    if registered < report.offered:
        lines.append(f"Chosen: {registered} of {counted(report.offered, 'crash', 'crashes')} in question.")
    for title, items in (
        ("in another cohort already, left there", [f"{key} ({other})" for key, other in done.elsewhere.items()]),
        ("the same report twice, merged", [f"{each.path} = {each.kept}" for each in report.duplicates]),
        (
            "a second, different report of the same crash, left aside",
            [f"{each.path} ({each.key} is read from {each.kept})" for each in report.conflicts],
        ),
        ("not a crash report", [f"{each.path}: {each.why}" for each in report.unrecognised]),
    ):
        if items:
            more = f", and {len(items) - _NAMED} more" if len(items) > _NAMED else ""
            lines.append(f"{len(items)} {title}: {'; '.join(items[:_NAMED])}{more}")
    return lines
