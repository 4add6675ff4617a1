"""Cohorts: ``cohort list``, ``show``, ``maps``, ``osmium`` and ``remove``; ``ingest`` makes them."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import ManyValuesCommand, OutputFile, examples, pass_root
from trace_dag.cli.printing import one_line, print_table, say, write_json
from trace_dag.common.errors import Failure, Rejection, UserError
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.messages.wording import count_of

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.registry import Cohort

_KEYS_SHOWN = 20


@click.group(epilog=examples("trace-dag cohort list"))
def cohort() -> None:
    """List, show and remove cohorts and their maps; ingest makes and extends them."""


@cohort.command("list", epilog=examples("trace-dag cohort list"))
@click.option("--json", "as_json", is_flag=True, help="As JSON.")
@pass_root
def list_cohorts(root: str, as_json: bool) -> None:
    """List the cohorts with their crashes and maps."""
    from trace_dag.common.storage.files import Storage
    from trace_dag.flow.cohorts.registry import Registry

    cohorts = Registry(Storage.open(root, to_read=True)).cohorts()
    if as_json:
        write_json([_summary(each) for each in cohorts.values()])
        return
    print_table(
        ["cohort", "crashes", "map files", "maps else from", "made", "last chosen as"],
        [
            (
                each.name,
                len(each.reports),
                len(each.maps),
                each.map_service,
                each.created_at[:16].replace("T", " "),
                each.origins[-1] if each.origins else "",
            )
            for each in cohorts.values()
        ],
    )


@cohort.command("show", epilog=examples("trace-dag cohort show virginia"))
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Everything, each crash and map included, as JSON.")
@pass_root
def show(root: str, name: str, as_json: bool) -> None:
    """Show a cohort's crashes, their kinds and their sources."""
    from trace_dag.common.storage.files import Storage
    from trace_dag.flow.cohorts.listings import kinds_of
    from trace_dag.flow.cohorts.registry import Registry

    storage = Storage.open(root, to_read=True)
    found = Registry(storage).cohort(name)
    kinds = kinds_of(storage, found.reports)
    if as_json:
        write_json(
            {
                **_summary(found),
                "kinds": dict(kinds),
                "reports": {key: asdict(report) for key, report in found.reports.items()},
                "maps": [asdict(file) for file in found.maps],
            }
        )
        return
    say(f"Cohort {found.name}: {count_of(len(found.reports), 'crash', 'crashes')}, made {found.created_at}")
    for kind, crashes in kinds.items():
        say(f"  {crashes} {kind} ({crashes / len(found.reports):.1%})")
    for origin in found.origins:
        say(f"  chosen from {origin}")
    for folder in found.watched:
        say(f"  watches {folder}")
    for file in found.maps:
        say(f"  map {file.location}")
    if found.map_service:
        say(f"  other maps from {found.map_service}")
    keys = found.keys
    more = f" and {len(keys) - _KEYS_SHOWN} more (--json lists all)" if len(keys) > _KEYS_SHOWN else ""
    say(f"  {', '.join(keys[:_KEYS_SHOWN])}{more}")


@cohort.command(
    "maps",
    cls=ManyValuesCommand,
    epilog=examples("trace-dag cohort maps", "trace-dag cohort maps --drop osm/damaged.osm"),
)
@click.option("--cohort", "name", help="Only of this cohort.")
@click.option("--drop", multiple=True, metavar="FILE", help="Leave this map file out from now on; its path or name.")
@pass_root
def maps(root: str, name: str | None, drop: tuple[str, ...]) -> None:
    """List the map files of the cohorts, or remove some from them.

    The files themselves stay where they are. The next run cuts extracts of a removed map anew.
    """
    from trace_dag.common.storage.files import Storage
    from trace_dag.flow.cohorts.kept_files import remove_unused_map_copies
    from trace_dag.flow.cohorts.registry import Registry

    storage = Storage.open(root, to_read=not drop)
    registry = Registry(storage)
    if drop:
        for cohort_name, files in registry.drop_maps(drop, name).items():
            say(f"Cohort {cohort_name}: left out {', '.join(files)}; trace-dag run does the rest.")
        remove_unused_map_copies(storage)
        return
    cohorts = [registry.cohort(name)] if name is not None else list(registry.cohorts().values())
    print_table(
        ["cohort", "map file", "MB"],
        [(each.name, file.location, f"{file.size / 1e6:.1f}") for each in cohorts for file in each.maps],
    )


@cohort.command("osmium", epilog=examples("trace-dag cohort osmium national --output crashes.json"))
@click.argument("name")
@click.option("--output", required=True, type=OutputFile(), help="File to write.")
@click.option("--map", "map_name", default="crashes.osm.pbf", show_default=True, help="What osmium is to call the map.")
@pass_root
def osmium(root: str, name: str, output: Path, map_name: str) -> None:
    """Write a configuration for osmium extract, to cut a cohort's places out of a country's map.

    The output is one map file with the surroundings of every crash whose report is at hand and has a position.
    """
    from trace_dag.crash.parse import reported_position
    from trace_dag.flow.cohorts.listings import listings_of
    from trace_dag.flow.workspace import Workspace
    from trace_dag.osm.catalog import osmium_config
    from trace_dag.osm.types import Site

    workspace = Workspace.open(root, to_read=True)
    reports = workspace.registry.cohort(name).reports
    sites = []
    for key, listing in listings_of(workspace.storage, reports).items():
        with suppress(Rejection):
            sites.append(Site(key, *reported_position(listing.latitude_deg, listing.longitude_deg)))
    if not sites:
        raise UserError(f"cohort {name}: no stored report has the position of its crash")
    settings = workspace.settings.osm
    output.write_text(osmium_config(sites, max(settings.radius_m, settings.surroundings_radius_m), map_name))
    crashes = count_of(len(reports), "crash", "crashes")
    say(f"{output}: the places of {len(sites)} of {crashes}; osmium extract --config {output} and a map file")


@cohort.command(
    "remove",
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag cohort remove virginia", "trace-dag cohort remove virginia --only 2023-510179 --artefacts"
    ),
)
@click.argument("name")
@click.option("--only", multiple=True, metavar="KEY", help="Take away only these of its crashes.")
@click.option("--artefacts", is_flag=True, help="Delete what was made of the crashes, too.")
@pass_root
def remove(root: str, name: str, only: tuple[str, ...], artefacts: bool) -> None:
    """Remove a cohort, or some of its crashes, and their partitions.

    Results of the crashes stay, unless --artefacts is given: registered again, they are up to date.
    """
    from trace_dag.assets.launch import dagster_records, summarise
    from trace_dag.assets.run_requests import remove_partitions
    from trace_dag.common.storage.files import Storage
    from trace_dag.export.crash_files import delete_artefacts
    from trace_dag.flow.cohorts.kept_files import remove_unused_map_copies
    from trace_dag.flow.cohorts.registry import Registry
    from trace_dag.flow.workspace import Workspace

    errors: tuple[str, ...] = ()
    storage, workspace = Storage.open(root), Workspace.open(root)
    registry = Registry(storage)
    gone = registry.leaving(name, only)
    with dagster_records(workspace) as instance:
        # The registry last: where this breaks off, the same command does the rest.
        remove_partitions(instance, gone)
        deleted = delete_artefacts(storage, gone) if artefacts else 0
        registry.remove(name, only)
        remove_unused_map_copies(storage)
    if workspace.warehouse.is_file():
        try:
            with dagster_records(workspace) as instance:
                errors = summarise(workspace, instance).errors
        except Failure as failure:
            errors = (str(failure),)
    say(
        f"Cohort {name}: {count_of(len(gone), 'crash', 'crashes')} removed"
        + (f", {count_of(deleted, 'file')} deleted." if artefacts else "; what was made of them is kept.")
    )
    for error in errors:
        print_problem(f"failed: {one_line(error, 500)}")
    if errors:
        print_problem(
            "The warehouse and the pages are as they were before; trace-dag verify --repair makes them again."
        )
        sys.exit(1)


def _summary(found: Cohort) -> dict[str, object]:
    return {
        "name": found.name,
        "crashes": len(found.reports),
        "map_files": len(found.maps),
        "map_service": found.map_service,
        "created_at": found.created_at,
        "origins": list(found.origins),
        "watched": list(found.watched),
    }
