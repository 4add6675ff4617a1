"""Metadata of a release for search engines and archives, and the definition of its benchmark.

Croissant (``croissant.json``) and DataCite (``datacite.json``).

Croissant 1.1 describes files and columns for tools of machine learning (Akhtar et al., Croissant: A metadata format for
ML-ready datasets, 2024). A repository needs DataCite's metadata schema 4.5 to give a DOI.

The definition, ``trace-bench.json``, is for two groups to compare their benchmarks. It names every crash with the
digests of its report, of the map data around it and of its package, the crash's part, the code and settings of every
stage, and the rules of comparison. :func:`differences` lists the inputs that differ. Belongs here: the content of the
definition. Does not belong here: releasing it (:mod:`trace_dag.export.release`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any, Final

from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.metrics import ENTERED_TTC_S
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.schemas import ColumnType, TableSchema
from trace_dag.common.stage import Stage
from trace_dag.flow.records import Records
from trace_dag.osm.types import Rights
from trace_dag.scenario.cases import MOST_TIMES
from trace_dag.version import __version__

_SPDX: Final = "https://spdx.org/licenses/"
_TYPES: Final = {
    ColumnType.TEXT: "sc:Text",
    ColumnType.INTEGER: "sc:Integer",
    ColumnType.REAL: "sc:Float",
    ColumnType.BOOLEAN: "sc:Boolean",
}
_CONTEXT: Final = resources.files("trace_dag.export").joinpath("templates", "croissant_context.json")
"""Context of the specification of Croissant 1.0."""
_KEYWORDS: Final = ("crash reconstruction", "FARS", "OpenSCENARIO", "OpenDRIVE", "automated driving")
FILE: Final = "trace-bench.json"
NAME: Final = "trace-bench 1"
_SHOWN: Final = 5


def croissant(
    name: str, version: str, published: str, about: str, rights: Rights, index: TableSchema, index_parquet: bytes
) -> bytes:
    """Return ``croissant.json``: the files of a release, and the columns of its index.

    ``published`` is a date.

    >>> from trace_dag.osm.types import OSM_ATTRIBUTION
    >>> from trace_dag.common.schemas import Column
    >>> index = TableSchema("index", "A row per crash", (Column("key", ColumnType.TEXT, "Key of the crash"),))
    >>> rights = Rights.of([OSM_ATTRIBUTION])
    >>> made = json.loads(croissant("crashes", "1.0", "2026-01-31", "Two crashes", rights, index, b""))
    >>> made["version"], made["recordSet"][0]["field"][0]["description"]  # Croissant asks for three numbers
    ('1.0.0', 'Key of the crash')
    """
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"crashes/{column.name}",
            "name": column.name,
            "description": column.meaning + (f" ({column.unit})" if column.unit else ""),
            "dataType": _TYPES[column.type or ColumnType.TEXT],
            "source": {"fileObject": {"@id": "index.parquet"}, "extract": {"column": column.name}},
        }
        for column in index.columns
    ]
    return _json(
        {
            "@context": json.loads(_CONTEXT.read_text(encoding="utf-8")),
            "@type": "sc:Dataset",
            "conformsTo": "http://mlcommons.org/croissant/1.0",
            "name": name,
            "version": _semantic(version),
            "description": about,
            "datePublished": published,
            "license": licences(rights),
            "url": f"https://pypi.org/project/trace-dag/{__version__}/",
            "creator": {"@type": "sc:Organization", "name": "The trace-dag authors"},
            "publisher": {"@type": "sc:Organization", "name": "The trace-dag authors"},
            "keywords": list(_KEYWORDS),
            "citeAs": f"The trace-dag authors: {name}, version {version}, {published[:4]}",
            "distribution": [
                {
                    "@type": "cr:FileObject",
                    "@id": "index.parquet",
                    "name": "index.parquet",
                    "description": "a row per crash, with its part of the split and its place (GeoParquet)",
                    "contentUrl": "index.parquet",
                    "encodingFormat": "application/x-parquet",
                    "sha256": hashlib.sha256(index_parquet).hexdigest(),
                },
                {
                    "@type": "cr:FileSet",
                    "@id": "packages",
                    "name": "packages",
                    "description": "a scenario package per crash; index.parquet has the SHA-256 of each",
                    "encodingFormat": "application/zip",
                    "includes": "packages/*.zip",
                },
            ],
            "recordSet": [
                {
                    "@type": "cr:RecordSet",
                    "@id": "crashes",
                    "name": "crashes",
                    "description": "the crashes of the release",
                    "key": {"@id": "crashes/key"},
                    "field": fields,
                }
            ],
        }
    )


def datacite(
    name: str, version: str, published: str, title: str, about: str, rights: Rights, box_deg: Sequence[float]
) -> bytes:
    """Return ``datacite.json``: all that a repository needs to give a DOI, without the DOI.

    ``box_deg`` is west, south, east, north of the crashes.

    >>> from trace_dag.osm.types import OSM_ATTRIBUTION
    >>> rights, box_deg = Rights.of([OSM_ATTRIBUTION]), (-83.7, 36.5, -75.2, 39.5)
    >>> made = json.loads(datacite("crashes", "1.0", "2026-01-31", "Crashes", "Two crashes", rights, box_deg))
    >>> made["publicationYear"], made["geoLocations"][0]["geoLocationBox"]["northBoundLatitude"]
    ('2026', 39.5)
    """
    west, south, east, north = box_deg
    return _json(
        {
            "schemaVersion": "http://datacite.org/schema/kernel-4",
            "types": {"resourceType": "Benchmark of crash scenarios", "resourceTypeGeneral": "Dataset"},
            "creators": [{"name": "The trace-dag authors", "nameType": "Organizational"}],
            "titles": [{"title": title}],
            "publisher": {"name": "The trace-dag authors"},
            "publicationYear": published[:4],
            "dates": [{"date": published, "dateType": "Created"}],
            "language": "en",
            "version": version,
            "subjects": [{"subject": each} for each in _KEYWORDS],
            "descriptions": [{"description": about, "descriptionType": "Abstract"}],
            "formats": ["application/zip", "application/x-parquet", "application/json"],
            "rightsList": [
                {"rightsIdentifier": each.removeprefix(_SPDX), "rightsUri": each, "rightsIdentifierScheme": "SPDX"}
                for each in licences(rights)
            ],
            "geoLocations": [
                {
                    "geoLocationBox": {
                        "westBoundLongitude": west,
                        "eastBoundLongitude": east,
                        "southBoundLatitude": south,
                        "northBoundLatitude": north,
                    }
                }
            ],
            "alternateIdentifiers": [
                {"alternateIdentifier": f"{name}-{version}", "alternateIdentifierType": "name of the release"}
            ],
        }
    )


def licences(rights: Rights) -> list[str]:
    """Return addresses of the licences of a release: its own and those of its maps.

    >>> from trace_dag.osm.types import OSM_ATTRIBUTION
    >>> licences(Rights.of([OSM_ATTRIBUTION]))
    ['https://spdx.org/licenses/CC0-1.0', 'https://spdx.org/licenses/ODbL-1.0']
    """
    names = {"CC0-1.0", *rights.licence.split(" AND ")}
    return [_SPDX + each for each in sorted(names) if not each.startswith("LicenseRef")]


def _semantic(version: str) -> str:
    """Return a version as three numbers, which Croissant asks for: 1.0 is 1.0.0."""
    numbers, dash, rest = version.partition("-")
    return ".".join([*numbers.split("."), "0", "0"][:3]) + dash + rest


def _json(document: Any) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()


# --- the definition of the benchmark ---------------------------------------------------------------------------------
def definition(
    rows: Sequence[Mapping[str, Any]], records: Mapping[str, Records], made_on: str, weights: Mapping[str, Any] | None
) -> bytes:
    """Return the definition of the crashes in ``rows`` of a release's index, as UTF-8 JSON.

    Equal input gives equal bytes. ``weights`` describes the weights of the rows, or is None.
    """
    usual = Conditions(traffic=Traffic.PERSISTENT)
    document = {
        "name": NAME,
        "date": made_on,
        "traffic": usual.traffic.value,
        "conditions": {"rate_hz": usual.rate_hz, "range_m": usual.sensing.range_m, "noise_m": 0.0, "seed": usual.seed},
        "scoring": {
            "places": "both drivers' places of each crash in which somebody met somebody",
            "entered_s": ENTERED_TTC_S,
            "finished_within_times": MOST_TIMES,
            "score": "share of runs with conflict_avoided or collision_avoided; interval with the crash as the unit",
        },
        "weights": weights,
        "stages": _stages(list(records.values())),
        "crashes": {row["key"]: _crash(row, records[row["key"]]) for row in rows},
    }
    return (json.dumps(document, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode()


def _stages(records: Sequence[Records]) -> dict[str, list[Any]]:
    """Return the code, settings and libraries of each stage, as a list; one entry if all crashes were made alike."""
    found: dict[str, list[Any]] = {}
    for stage in Stage:
        made = [record[stage].provenance for record in records if stage in record]
        unlike = {json.dumps([each.code, each.settings, each.libraries], sort_keys=True) for each in made}
        found[stage.value] = [json.loads(each) for each in sorted(unlike)]
    return found


def _crash(row: Mapping[str, Any], record: Records) -> dict[str, Any]:
    (report, *_), (extract, *_) = record[Stage.RAW_REPORT].artefacts, record[Stage.OSM_EXTRACT].artefacts
    return {
        "kind": row["kind"],
        "split": row["split"],
        "weight": row["weight"],
        "report_sha256": report.sha256,
        "map_file": record[Stage.OSM_EXTRACT].figures.get("source"),
        "map_sha256": extract.sha256,
        "package_sha256": row["package_sha256"],
    }


def read_definition(data: bytes, name: str) -> dict[str, Any]:
    """Return a definition as read.

    Raises :class:`UserError` for other content or another version.
    """
    try:
        document = json.loads(data)
        if document["name"] == NAME and isinstance(document["crashes"], dict):
            return dict(document)
    except (ValueError, KeyError, TypeError):
        pass
    raise UserError(f"{name}: not a definition of {NAME}; a release has one as {FILE}")


def differences(given: Mapping[str, Any], made: Mapping[str, Any]) -> list[str]:
    """Return one sentence for each input that differs from a given definition.

    An input that follows from others is listed only if those are equal.

    >>> crash = {"report_sha256": "1", "map_sha256": "2", "package_sha256": "3"}
    >>> given = {"stages": {}, "weights": None, "crashes": {"2023-1": crash, "2023-2": crash}}
    >>> differences(given, given | {"crashes": {"2023-1": crash | {"report_sha256": "9"}}})
    ['not verified here: 2023-2', 'another report: 2023-1']
    """
    theirs, ours = given["crashes"], made["crashes"]
    both = [key for key in theirs if key in ours]

    def unlike(name: str) -> list[str]:
        return [key for key in both if theirs[key][name] != ours[key][name]]

    unlike_stages = [stage for stage, each in given["stages"].items() if each != made["stages"].get(stage)]
    found = [
        _named("not verified here", [key for key in theirs if key not in ours]),
        _named("another report", unlike("report_sha256")),
        _named("map files that differ around", unlike("map_sha256")),
        _named("other code, settings or libraries in", unlike_stages),
        "" if given["weights"] == made["weights"] else "other national tables, or none: --national",
    ]
    found = [each for each in found if each]
    if not found and given != made:
        found = [_named("another package", unlike("package_sha256")) or "another version of trace-dag"]
    return found


def _named(what: str, names: Sequence[str]) -> str:
    more = f" and {count_of(len(names) - _SHOWN, 'other')}" if len(names) > _SHOWN else ""
    return f"{what}: {', '.join(names[:_SHOWN])}{more}" if names else ""
