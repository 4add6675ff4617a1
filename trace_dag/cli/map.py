"""OpenStreetMap as OpenDRIVE, without a crash: ``map``."""

from __future__ import annotations

from pathlib import Path

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import say
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.messages.wording import count_of
from trace_dag.export.formats import MAP_FORMS


class _Numbers(click.ParamType[tuple[float, ...]]):
    """Numbers with commas between them, as many as there are names."""

    def __init__(self, names: str) -> None:
        self.name = names

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        try:
            numbers = tuple(float(each) for each in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != len(self.name.split(",")):
            self.fail(f"{value!r} is not {self.name}, in degrees", param, ctx)
        return numbers


@click.command(
    "map",
    epilog=examples(
        "trace-dag map --osm tempe-az.osm.pbf --at 33.4255,-111.94 -o tempe",
        "trace-dag map --at 33.4255,-111.94 --radius 250 --format geojson -o tempe",
        "trace-dag map --osm district.osm --format sumo --format glb -o district",
    ),
)
@click.option("--at", type=_Numbers("LAT,LON"), metavar="LAT,LON", help="The middle of the map.")
@click.option("--radius", "radius_m", default=400.0, show_default=True, help="How far it reaches around --at, metres.")
@click.option("--box", type=_Numbers("W,S,E,N"), metavar="W,S,E,N", help="The borders of the map instead, degrees.")
@click.option(
    "--osm",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="OpenStreetMap data (.osm, .osm.gz, .osm.bz2, .pbf) or a folder of it; else Overpass is asked.",
)
@click.option(
    "--format",
    "forms",
    multiple=True,
    type=click.Choice(MAP_FORMS),
    help="Also the lanes for geographic tools, or the map for CommonRoad, Lanelet2, ScenarioNet and MetaDrive, SUMO "
    "(the extra sumo) or viewers of glTF.",
)
@click.option(
    "--traffic",
    type=click.Choice(["right", "left"]),
    default="right",
    show_default=True,
    help="The side that traffic keeps to.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("map"),
    show_default=True,
    help="The folder for map.xodr, map.json and map.png.",
)
def map_command(
    at: tuple[float, float] | None,
    radius_m: float,
    box: tuple[float, float, float, float] | None,
    osm: tuple[Path, ...],
    forms: tuple[str, ...],
    traffic: str,
    output: Path,
) -> None:
    """Make an OpenDRIVE map of OpenStreetMap data: around a place, in a box, or of a whole small file.

    Needs no storage root and no crash. map.json has the gates measured for every road, and the tags that the map does
    not follow.
    """
    from trace_dag.common.storage.disk_errors import name_file_in_errors
    from trace_dag.reading.road_map import make_map

    made = make_map(osm, at=at, radius_m=radius_m, box=box, left_hand=traffic == "left")
    with name_file_in_errors(output):
        written = made.save(output, dict.fromkeys(forms))
    failed = [gate for gate in made.gates if gate.passed is False]
    roads = sum(road.junction_id is None for road in made.network.roads)
    holds = f"{len(made.gates) - len(failed)} of {len(made.gates)} gates hold"
    say(f"{count_of(roads, 'road')}, {count_of(len(made.network.junctions), 'junction')}, {holds}")
    for gate in failed:
        where = f", road {', '.join(gate.road_ids)}" if gate.road_ids else ""
        print_problem(f"does not hold: {gate.name.replace('_', ' ')}{where}: {gate.detail or gate.value}")
    for path in written:
        say(f"{path}  {path.stat().st_size // 1024 + 1} kB")
