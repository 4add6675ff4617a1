"""Stage ``osm_extract``: the roads around each crash, for many crashes from one reading of each map file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.common.errors import Failure, Rejection, TransientFailure
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.registry import RegisteredMap
from trace_dag.flow.contract import CrashFiles, Figure, StageProduct
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.services import MapSource
from trace_dag.osm.stored import write_extract
from trace_dag.osm.types import OsmExtract, Site

if TYPE_CHECKING:
    from trace_dag.common.settings import OsmSettings
    from trace_dag.crash.record import CrashRecord
    from trace_dag.flow.cohorts.services import Services


def osm_extract(
    record: Mapping[str, CrashRecord],
    maps: Mapping[str, tuple[RegisteredMap, ...]],
    map_service: Mapping[str, str | None],
    services: Services,
    settings: OsmSettings,
) -> Mapping[str, StageProduct | Rejection | Failure]:
    """Return the roads around each crash, from one reading of each map file.

    The cohort's service is used for crashes that no file covers.
    """
    answers: dict[str, StageProduct | Rejection | Failure] = {}
    by_maps: dict[tuple[tuple[RegisteredMap, ...], str | None], list[Site]] = {}
    for key, of_crash in record.items():
        site = Site(key, of_crash.latitude_deg, of_crash.longitude_deg)
        by_maps.setdefault((maps[key], map_service[key]), []).append(site)
    for (files, service), sites in by_maps.items():
        found = catalog_of(files, services).extract(sites, settings)
        if service is not None:
            uncovered = [site for site in sites if isinstance(found[site.key], Rejection)]
            found.update(_ask(services.map_source(service), uncovered, settings))
        for key, answer in found.items():
            answers[key] = answer if isinstance(answer, Rejection | Failure) else _product(answer)
    return answers


def _product(extract: OsmExtract) -> StageProduct:
    figures: dict[str, Figure] = {
        "ways": len(extract.ways),
        "nodes": len(extract.nodes),
        "turn_restrictions": len(extract.relations),
        "things_beside_roads": len(extract.surroundings),
        "source": extract.source,
        "data_timestamp": extract.data_timestamp,
        "attribution": extract.attribution,
    }
    pbf, geojson = write_extract(extract)
    return StageProduct({"osm.pbf": pbf, "geojson": geojson}, figures)


def _ask(
    source: MapSource, sites: Sequence[Site], settings: OsmSettings
) -> dict[str, OsmExtract | Rejection | Failure]:
    """Return extracts from a public service, one by one, so that a site without an answer does not affect others."""
    answers: dict[str, OsmExtract | Rejection | Failure] = {}
    for site in sites:
        try:
            answers.update(source.extract([site], settings))
        except Failure as failure:
            answers[site.key] = failure
    return answers


def catalog_of(maps: tuple[RegisteredMap, ...], services: Services) -> MapCatalog:
    """Return the map files of a cohort; opened once per process."""
    files: list[Path | Failure] = []
    for file in maps:
        try:
            files.append(services.map_file(file))
        except TransientFailure:
            raise
        except Failure as failure:
            files.append(failure)
    return _opened(tuple(files))


@lru_cache(maxsize=8)
def _opened(files: tuple[Path | Failure, ...]) -> MapCatalog:
    return MapCatalog.of_registered(files)


def by_map_files(crashes: Sequence[CrashFiles]) -> list[list[str]]:
    """Return groups of crashes in the same map files, so that each file is read once; small groups are joined.

    Crashes outside all map files fill up the groups.
    """
    most = crashes[0].settings.execution.chunk_size
    groups: dict[tuple[tuple[RegisteredMap, ...], tuple[int, ...]], list[str]] = {}
    for crash in crashes:
        figures = crash.figures(Stage.CRASH_RECORD)
        latitude_deg, longitude_deg = float(figures["latitude_deg"] or 0), float(figures["longitude_deg"] or 0)
        boxes = [file.header.box for file in catalog_of(crash.source.maps, crash.services).files]
        covering = tuple(
            index for index, box in enumerate(boxes) if box is None or box.contains(latitude_deg, longitude_deg)
        )
        groups.setdefault((crash.source.maps, covering), []).append(crash.key)
    alone = [keys for (_, covering), keys in groups.items() if not covering]
    shared = [keys for (_, covering), keys in groups.items() if covering]
    pieces = [keys[start : start + most] for keys in alone for start in range(0, len(keys), most)]
    joined: list[list[str]] = []
    for group in sorted([*shared, *pieces], key=len, reverse=True):
        if joined and len(joined[-1]) + len(group) <= most:
            joined[-1].extend(group)
        else:
            joined.append(group)
    return joined
