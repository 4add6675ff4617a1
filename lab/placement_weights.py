"""Placement weights: how often a reported fact holds for the crash's road, and for the others around.

    python -m lab placement_weights ROOT [ROOT ...]

The own road of a crash with a stored map is the nearest one, within 100 m of the reported point, that bears the name
reported; the others are those there whose names are known and are others. It prints how often each reported fact
holds for the one and for the others, and the logarithm of the ratio, which is what a weight in
``trace_dag/roads/crash_site/placement.py`` stands for. Names decide which road is which, so their own weight cannot
be measured so."""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from trace_dag.crash.record import CrashRecord
from trace_dag.crash.tables import record_from_parquet
from trace_dag.roads.crash_site.placement import class_steps
from trace_dag.roads.crash_site.reported_road import (
    is_numbered_as_reported,
    lanes_as_reported,
    pair_of,
    trafficway_of,
    trafficway_on_map,
)
from trace_dag.roads.crash_site.street_names import OTHER_STREET, SAME_STREET, similarity
from trace_dag.roads.crash_site.streets import carriageway_at
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive

AROUND_M = 100.0
SAME_SPEED_MPS = 1.2
DISTANCES_M = (0.0, 3.0, 6.0, 12.0, 25.0, 50.0, AROUND_M)
CLASS_STEPS = (0.9, 1.7, 2.7, math.inf)


def roads_near(network: RoadNetwork, record: CrashRecord) -> dict[str, float]:
    """Return roads outside junctions near the reported point, and how far beside their surface it lies, m."""
    x_m, y_m = network.frame.to_local(record.latitude_deg, record.longitude_deg).tolist()
    near: dict[str, float] = {}
    for match in network.nearest_lanes(float(x_m), float(y_m), AROUND_M):
        road = network.road_by_id[match.lane.road_id]
        if road.junction_id is None and not road.inferred:
            near[road.id] = min(near.get(road.id, math.inf), match.outside_m)
    return near


def said(network: RoadNetwork, record: CrashRecord, road: Road, distance_m: float) -> Iterator[tuple[str, str]]:
    """Return the reported facts of the road, and their outcomes for a road: pairs of subject and outcome."""
    bin_m = next(limit for limit in DISTANCES_M if distance_m <= limit)
    yield "distance", f"at most {bin_m:g} m"
    steps = class_steps(record, road)
    if steps is not None:
        yield "class", f"less than {next(limit for limit in CLASS_STEPS if steps < limit):g} steps apart"
    x_m, y_m = network.frame.to_local(record.latitude_deg, record.longitude_deg).tolist()
    street = carriageway_at(network, road.id, float(x_m), float(y_m))
    vehicles = pair_of(record)
    ways = [way for vehicle in vehicles if (way := trafficway_of(vehicle)) is not None]
    if ways:
        yield "trafficway", "same" if trafficway_on_map(street) in ways else "another"
    if road.lanes_from_tags and any(vehicle.lanes for vehicle in vehicles):
        fits = any(v.lanes in lanes_as_reported(street, trafficway_of(v)) for v in vehicles if v.lanes)
        yield "lanes", "same" if fits else "another"
    limits = [vehicle.speed_limit_mps for vehicle in vehicles if vehicle.speed_limit_mps]
    if limits and road.speed_mps is not None:
        posted = road.speed_mps
        same = any(abs(limit - posted) < SAME_SPEED_MPS for limit in limits)
        yield "limit", "same" if same else "another"
    numbered = is_numbered_as_reported(record, road)
    if numbered is not None:
        yield "route", "same" if numbered else "another"
    yield "ramp", "yes" if road.highway.endswith("_link") else "no"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", nargs="+", type=Path, metavar="ROOT")
    counts: dict[bool, Counter[tuple[str, str]]] = {True: Counter(), False: Counter()}
    crashes = others = 0
    for path in sorted(path for root in parser.parse_args().roots for path in (root / "road_map").glob("*.xodr")):
        key = path.name.partition(".")[0]
        record = record_from_parquet((path.parents[1] / "crash_record" / f"{key}.parquet").read_bytes())
        network = read_opendrive(path.read_bytes(), name=path.name)
        named: list[tuple[float, Road]] = []
        for road_id, distance_m in roads_near(network, record).items():
            road = network.road_by_id[road_id]
            alike = similarity(record.trafficway_1, road.names)
            if alike is not None and alike >= SAME_STREET:
                named.append((distance_m, road))
            elif alike is not None and alike < OTHER_STREET:
                others += 1
                counts[False].update(said(network, record, road, distance_m))
        if named:
            crashes += 1
            distance_m, own = min(named, key=lambda pair: (pair[0], pair[1].id))
            counts[True].update(said(network, record, own, distance_m))
    print(f"{crashes} crashes with a road of the name reported, {others} roads of other names near them")
    for subject, outcome in sorted({*counts[True], *counts[False]}):
        shares = []
        for each in (True, False):
            told = sum(count for (about, _), count in counts[each].items() if about == subject)
            shares.append((counts[each][subject, outcome] + 0.5) / (told + 1.0))  # never 0: few were counted
        of_own, of_others = counts[True][subject, outcome], counts[False][subject, outcome]
        ratio = math.log(shares[0] / shares[1])
        print(
            f"{subject:12} {outcome:28} {of_own:5d} {shares[0]:6.1%} {of_others:6d} {shares[1]:6.1%}   ln {ratio:+.2f}"
        )


if __name__ == "__main__":
    main()
