"""Registering crashes: ``ingest``."""

from __future__ import annotations

import shlex
import uuid
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.ingest_options import choice_of, choice_options
from trace_dag.cli.options import ManyValuesCommand, examples
from trace_dag.cli.printing import progress_bar, say
from trace_dag.common.errors import Failure, UserError, UserErrors
from trace_dag.common.messages.wording import count_of

if TYPE_CHECKING:
    from trace_dag.common.messages.progress import OnProgress
    from trace_dag.crash.registers.table import RegisterTable
    from trace_dag.crash.reported_place import PlaceFinder
    from trace_dag.flow.cohorts.choice import Choice
    from trace_dag.flow.cohorts.ingest import IngestReport
    from trace_dag.flow.workspace import Workspace
    from trace_dag.language.narratives.source import NarratedTable, NarrativeFolder, Reader

_NAMED = 10


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag ingest --states Virginia --years 2023",
        "trace-dag ingest --reports reports/ --maps virginia.osm.pbf --cohort virginia",
        "trace-dag ingest --fars-csv FARS2023NationalCSV.zip --maps overpass --states VA --sample 100",
        "trace-dag ingest --register my_state.toml crashes.csv --check",
    ),
)
@click.option("--reports", multiple=True, metavar="PATH", help="Folders or files of CrashAPI XML reports.")
@click.option("--fars-csv", multiple=True, metavar="PATH", help="FARS national CSV files: folders or zips.")
@click.option(
    "--register",
    nargs=2,
    multiple=True,
    metavar="NAME TABLE",
    help="A table of another register than FARS, as CSV: the name of one whose mapping is part of the package (tempe, "
    "montgomery), or a mapping file of yours (my_state.toml).",
)
@click.option(
    "--narratives",
    multiple=True,
    metavar="FOLDER",
    help="Folders of crash narratives, a text file each, which the language model of the settings reads.",
)
@click.option(
    "--check",
    is_flag=True,
    help="Say what of --register and --narratives would be read, kind by kind, and register nothing.",
)
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
@click.option("--cohort", help="Name of the cohort the crashes belong to; else default, or as virginia-2023.")
@choice_options
@click.option(
    "--watch",
    is_flag=True,
    help="Let the UI register what arrives in the folders of --reports or is released by the CrashAPI later.",
)
@click.option(
    "--download", is_flag=True, help="Where no source is given: download the files that the states and years need."
)
@click.option("--refresh", is_flag=True, help="Ask the CrashAPI again for what it answered before.")
@click.pass_obj
def ingest(
    root: str,
    /,
    reports: tuple[str, ...],
    fars_csv: tuple[str, ...],
    register: tuple[tuple[str, str], ...],
    narratives: tuple[str, ...],
    check: bool,
    source: tuple[tuple[str, str], ...],
    crashapi: bool,
    maps: tuple[str, ...],
    cohort: str | None,
    watch: bool,
    download: bool,
    refresh: bool,
    **options: Any,
) -> None:
    """Register crashes and the maps to find their roads in.

    With --states and --years, or --cases, alone, it names the files of NHTSA and Geofabrik that are needed and where
    they are published. It takes them from this folder or from Downloads, and with --download fetches those that are
    missing.

    Sources are folders of reports, the national CSV files, tables of other registers and the CrashAPI, one or several.
    Filters and samples choose among their crashes; a filter leaves out a crash whose source lacks the filtered value.
    Filters other than state, year, county name and vehicles request every candidate report from the CrashAPI.

    Each crash takes the map that covers it. A repeated ingest adds only new crashes and maps; maps can also be added
    alone, later.
    """
    from trace_dag.common.plugins import PluginKind, list_plugins
    from trace_dag.common.storage.files import Storage
    from trace_dag.crash.registers.table_check import check_table
    from trace_dag.flow.cohorts.ingest import ingest as ingest_into
    from trace_dag.flow.cohorts.public_files import name_of
    from trace_dag.flow.cohorts.services import crash_api
    from trace_dag.flow.cohorts.sources import TableSource
    from trace_dag.flow.workspace import Workspace

    choice = choice_of(options)
    services = [path for path in maps if path in list_plugins(PluginKind.MAP_SOURCE)]
    map_files = [Path(path) for path in maps if path not in services]
    read = _read_sources(root, register, narratives, map_files)
    if check:
        if not read:
            raise UserError("ingest: --check needs --register or --narratives, the table to check")
        for table in read.values():
            for line in check_table(table, Workspace.open(root).settings.crash):
                say(line)
        return
    if not (reports or maps or fars_csv or read or source or crashapi):
        cohort = cohort or name_of(choice)
        found = _public_files(root, choice, download=download)
        fars_csv = tuple(str(path) for path in found if path.suffix == ".zip")
        maps = tuple(str(path) for path in found if path.suffix == ".pbf")
    cohort = cohort or "default"
    if watch and not (reports or crashapi):
        raise UserError("ingest: --watch needs --reports, the folders to watch, or --crashapi")
    if watch and crashapi and (choice.cases or choice.sample or choice.stratified):
        raise UserError(
            "ingest: --watch takes every crash that the filters admit; leave out --sample, --stratified and --cases"
        )
    Storage.open(root)
    workspace = Workspace.open(root)
    if len(services) > 1:
        raise UserError(f"ingest: a cohort asks one service for maps, not {' and '.join(services)}")
    with progress_bar("reports looked up") as on_progress:
        report = ingest_into(
            workspace.storage,
            cohort,
            reports=[Path(path) for path in reports],
            maps=map_files,
            tables=[
                *(TableSource.of_plugin(*each) for each in (*(("fars-csv", path) for path in fars_csv), *source)),
                *(TableSource(name, table) for name, table in read.items()),
            ],
            crash_api=crash_api(workspace.settings.services, workspace.storage, refresh=refresh) if crashapi else None,
            choice=choice,
            map_service=services[0] if services else None,
            watch=watch,
            progress=on_progress,
        )
    _add_partitions(root)
    for line in [*_lines(report, cohort), *_coverage(workspace, cohort), _next_command(workspace, cohort)]:
        say(line)


def _read_sources(
    root: str, register: Iterable[tuple[str, str]], narratives: Iterable[str], maps: Sequence[Path]
) -> dict[str, RegisterTable | NarratedTable | NarrativeFolder]:
    """Return the tables of registers and the folders of narratives, by their origin in the cohort."""
    from trace_dag.crash.registers.table import RegisterTable

    find = None
    if maps and (register or narratives):
        from trace_dag.roads.crash_site.named_places import find_places

        find = partial(find_places, maps)
    tables = [RegisterTable.open(name, Path(table), find) for name, table in register]
    found: dict[str, RegisterTable | NarratedTable | NarrativeFolder] = {
        f"register {table.mapping.register_name}": table for table in tables
    }
    if narratives or any(table.mapping.crash.narrative for table in tables):
        from trace_dag.language.narratives.source import NarratedTable, NarrativeFolder

        with progress_bar("narratives read") as on_progress:
            reader = _narrative_reader(root, find, on_progress)
            told: dict[str, NarratedTable | NarrativeFolder] = {
                name: NarratedTable(table, reader)
                for name, table in zip(found, tables, strict=True)
                if table.mapping.crash.narrative
            }
            told |= {f"narratives {Path(folder).name}": NarrativeFolder(Path(folder), reader) for folder in narratives}
            for source in told.values():
                source.records()  # read while the bar is shown
            found |= told
    return found


def _narrative_reader(root: str, find: PlaceFinder | None, on_progress: OnProgress) -> Reader:
    """Return the reader of narratives: the language model of the settings.

    Raises UserError if the model cannot be used.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.language.hypotheses import llm_client
    from trace_dag.language.narratives.source import Reader

    workspace = Workspace.open(root)
    settings = workspace.settings.states
    client = llm_client(settings, files=workspace.storage, ledger=f"narratives-{uuid.uuid4().hex}")
    try:
        client.try_out()
    except Failure as failure:
        raise UserError(f"narratives are read by a language model, and it cannot be asked: {failure}") from failure
    return Reader(client, settings.llm_model, attempts=settings.llm_max_attempts, find=find, on_progress=on_progress)


def _next_command(workspace: Workspace, cohort: str) -> str:
    from trace_dag.flow.workspace import storage_root

    own = "" if workspace.root == storage_root() else f"--root {shlex.quote(workspace.root)} "
    registered = workspace.registry.cohort(cohort)
    if not registered.reports:
        return f"Next, its crashes: trace-dag {own}ingest --reports FOLDER --cohort {shlex.quote(cohort)}"
    if not registered.maps and not registered.map_service:
        return f"Next, its maps: trace-dag {own}ingest --maps FILE --cohort {shlex.quote(cohort)}"
    return f"Next: trace-dag {own}run --cohort {shlex.quote(cohort)}"


def _public_files(root: str, choice: Choice, *, download: bool) -> list[Path]:
    """Return the local paths of the files for the states and years of a choice.

    Missing files are downloaded, or raise UserErrors that name them and where they are published.
    """
    from trace_dag.flow.cohorts.public_files import files_of, folders_to_look_in
    from trace_dag.flow.cohorts.services import downloader
    from trace_dag.flow.workspace import Workspace

    wanted, folders = files_of(choice), folders_to_look_in()
    found = {each: each.found(folders) for each in wanted}
    missing = [each for each, path in found.items() if path is None]
    if missing and not download:
        raise UserErrors(
            [f"needed, and not here or in Downloads: {each.what}, {each.url}" for each in missing]
            + [
                f"put {'it' if len(missing) == 1 else 'them'} into this folder and run the same command again, or add "
                "--download to have that done"
            ]
        )
    if missing:
        workspace = Workspace.open(root)
        with downloader(workspace.settings.services, workspace.storage) as client:
            for each in missing:
                say(f"Downloading {each.what}: {each.url}")
                client.download(each.url, target := Path.cwd() / each.name)
                found[each] = target
    for each, path in found.items():
        say(f"{each.what[0].upper()}{each.what[1:]}: {path}")
    return [path for path in found.values() if path is not None]


def _coverage(workspace: Workspace, cohort: str) -> list[str]:
    """Return the number of a cohort's crashes within the stated extent of its map files."""
    from trace_dag.flow.cohorts.listings import listings_of
    from trace_dag.osm.catalog import MapCatalog, box_around, is_on_earth, may_cover
    from trace_dag.osm.types import Site

    registered = workspace.registry.cohort(cohort)
    if not registered.maps or registered.map_service or workspace.storage.local_root is None:
        return []
    headers = [file.header for file in MapCatalog.open(each.location for each in registered.maps).files]
    if not all(header.box for header in headers):
        return []  # only a whole reading tells what such a file covers
    sites = [
        Site(each.key, each.latitude_deg, each.longitude_deg)
        for each in listings_of(workspace.storage, registered.reports).values()
        if each.latitude_deg is not None and each.longitude_deg is not None
    ]
    within = sum(
        is_on_earth(site) and any(may_cover(header, box_around(site, 1.0)) for header in headers) for site in sites
    )
    return [f"Coverage: {within} of {count_of(len(registered.reports), 'crash', 'crashes')} lie where the maps reach."]


def _add_partitions(root: str) -> None:
    from trace_dag.assets.launch import dagster_records
    from trace_dag.assets.run_requests import add_partitions
    from trace_dag.common.storage.files import Storage
    from trace_dag.flow.cohorts.registry import Registry
    from trace_dag.flow.workspace import Workspace

    with dagster_records(Workspace.open(root)) as instance:
        add_partitions(instance, Registry(Storage(root)).keys())


def _lines(report: IngestReport, cohort: str) -> list[str]:
    done = report.registration
    lines = [
        *report.notes,
        f"Cohort {cohort}: {count_of(len(done.added), 'crash', 'crashes')} registered, "
        f"{len(done.known)} known already, {len(done.changed)} with a changed report; "
        f"{count_of(report.maps, 'map file')}, {done.maps_added} of them new.",
    ]
    registered = len(done.added) + len(done.known) + len(done.changed) + len(done.elsewhere)
    if registered < report.offered:
        lines.append(f"Chosen: {registered} of {count_of(report.offered, 'crash', 'crashes')} in question.")
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
