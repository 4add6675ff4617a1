"""Pictures of road maps to look at: ten kinds of place from above, and published maps beside ours of the same sites.

    python benchmarks/map_pictures.py ../shared/data pictures

For each kind the first of the FARS sites and the places drawn at random that shows it is drawn twice, with what the law
paints and by height. ``published-*.png`` are the published map and ours of one Virginia site each, in one window.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parent))

from PIL import Image
from roads import Places, cut, fars_sites, random_sites, virginia

from trace_dag.roads.crash_site.crossings import with_kinds
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.gates.measures import crossings
from trace_dag.roads.map.model import LaneType, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.scenario.canvas import pixels_of
from trace_dag.scenario.map_scene import Window
from trace_dag.scenario.maps import draw_network
from trace_dag.settings import RoadSettings

_WIDTH_PX = 600
_WINDOW_M = 75.0  # half its side
_PUBLISHED_WINDOW_M = 60.0
_NEAR_M = 45.0  # what is this near the middle is in the picture

Seen = tuple[RoadNetwork, list[Road]]
"""A map and its roads in the middle of the picture."""


def _lanes(seen: Seen, *types: LaneType) -> bool:
    return any(lane.type in types for road in seen[1] for section in road.lane_sections for lane in section.lanes)


def _signs(seen: Seen, *types: str) -> bool:
    return any(signal.type in types for road in seen[1] for signal in road.signals)


def _classes(seen: Seen, *classes: str) -> int:
    return sum(road.highway in classes for road in seen[1])


def _of_kind(seen: Seen, kind: str) -> bool:
    junctions = {road.junction_id for road in seen[1]}
    return any(junction.kind == kind and junction.id in junctions for junction in seen[0].junctions)


KINDS: dict[str, Callable[[Seen], bool]] = {
    "roundabout": lambda seen: _of_kind(seen, "roundabout"),
    "overpass": lambda seen: any(
        crossing.separated and max(abs(crossing.x_m), abs(crossing.y_m)) < _NEAR_M for crossing in crossings(seen[0])
    ),
    "motorway ramps": lambda seen: _classes(seen, "motorway") > 0 and _classes(seen, "motorway_link") > 0,
    "signals": lambda seen: _signs(seen, "1000001") and _of_kind(seen, "four_way") and _classes(seen, "secondary") > 3,
    "stop signs": lambda seen: _signs(seen, "206") and not _signs(seen, "1000001"),
    "centre turn lane": lambda seen: _lanes(seen, LaneType.BIDIRECTIONAL),
    "painted turn lanes": lambda seen: any(
        len(lane.turns) == 1 for road in seen[1] for section in road.lane_sections for lane in section.lanes
    ),
    "y junction": lambda seen: _of_kind(seen, "y"),
    "car park": lambda seen: _classes(seen, "service") > 8 and _classes(seen, "secondary", "primary") > 0,
    "country road": lambda seen: 0 < len(seen[1]) < 4 and not _classes(seen, "residential", "service"),
}


def seen_in_the_middle(network: RoadNetwork) -> Seen:
    """The roads near the origin, those through junctions included."""
    lines = [_line(network, road.id) for road in network.roads]
    near = shapely.dwithin(np.array(lines, dtype=object), shapely.Point(0, 0), _NEAR_M)
    return network, [road for road, is_near in zip(network.roads, near, strict=True) if is_near]


def _line(network: RoadNetwork, road_id: str) -> shapely.LineString:
    line = network.road_geometry(road_id).line
    return shapely.LineString(line.sample(line.stations(5.0))[:, :2])


def draw_kind(network: RoadNetwork, path: Path) -> None:
    """The map as painted and by height, beside each other."""
    window = (-_WINDOW_M, -_WINDOW_M, _WINDOW_M, _WINDOW_M)
    beside([draw_network(network, window), draw_network(network, window, heights=True)], path)


def beside(svgs: list[str], path: Path) -> None:
    """Write drawings beside each other as a PNG."""
    pictures = [pixels_of(svg, _WIDTH_PX) for svg in svgs]
    sheet = Image.new("RGB", (len(pictures) * _WIDTH_PX, pictures[0].height))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (number * _WIDTH_PX, 0))
    sheet.save(path)


def shifted(window: Window, network: RoadNetwork, first: RoadNetwork) -> Window:
    """A window of the first map's frame in that of another one."""
    east, north = first.frame.to_local(network.frame.latitude_deg, network.frame.longitude_deg)
    return window[0] - east, window[1] - north, window[2] - east, window[3] - north


def main() -> int:
    """Draw the kinds, then the published maps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--published", type=int, default=6, help="how many Virginia sites (default 6)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    places: Places = cut(arguments.data, [*fars_sites(arguments.data), *random_sites(arguments.data, 200)])
    wanted = dict(KINDS)
    for key, (extract, frame) in places.items():
        if not wanted:
            break
        seen = seen_in_the_middle(with_kinds(convert(extract, frame, RoadSettings()), extract))
        kind = next((kind for kind, shows in wanted.items() if shows(seen)), None)
        if kind is not None:
            del wanted[kind]
            draw_kind(seen[0], arguments.out / f"{kind.replace(' ', '-')}.png")
            print(f"{kind}: {key}")
    for kind in wanted:
        print(f"{kind}: none of the {len(places)} sites shows it")
    sites = list(virginia(arguments.data).items())
    for name, (extract, frame) in sites[:: max(1, len(sites) // arguments.published)][: arguments.published]:
        published = arguments.data / "va-2023" / "published" / "maps" / f"{name}.xodr"
        theirs = read_opendrive(published.read_bytes(), name=published.name)
        ours = convert(extract, frame, RoadSettings())
        window = (-_PUBLISHED_WINDOW_M, -_PUBLISHED_WINDOW_M, _PUBLISHED_WINDOW_M, _PUBLISHED_WINDOW_M)
        drawings = [draw_network(theirs, window), draw_network(ours, shifted(window, ours, theirs))]
        beside(drawings, arguments.out / f"published-{name}.png")
        print(f"published-{name}.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
