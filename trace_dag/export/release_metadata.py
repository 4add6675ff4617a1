"""Metadata of a release for search engines and archives.

Croissant (``croissant.json``) and DataCite (``datacite.json``).

Croissant 1.1 describes files and columns for tools of machine learning (Akhtar et al., Croissant: A metadata format for
ML-ready datasets, 2024). A repository needs DataCite's metadata schema 4.5 to give a DOI.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any, Final

from trace_dag.common.schemas import ColumnType, TableSchema
from trace_dag.osm.rights import Rights
from trace_dag.version import __version__

_SPDX: Final = "https://spdx.org/licenses/"
_TYPES: Final = {
    ColumnType.TEXT: "sc:Text",
    ColumnType.INTEGER: "sc:Integer",
    ColumnType.REAL: "sc:Float",
    ColumnType.BOOLEAN: "sc:Boolean",
}
_KEYWORDS: Final = ("crash reconstruction", "FARS", "OpenSCENARIO", "OpenDRIVE", "automated driving")
_CONTEXT: Final[dict[str, Any]] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
"""Context of the specification of Croissant 1.0."""


def croissant(
    name: str, version: str, published: str, about: str, rights: Rights, index: TableSchema, index_parquet: bytes
) -> bytes:
    """Return ``croissant.json``: the files of a release, and the columns of its index.

    ``published`` is a date.

    >>> from trace_dag.osm.rights import OSM_ATTRIBUTION
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
            "@context": _CONTEXT,
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

    >>> from trace_dag.osm.rights import OSM_ATTRIBUTION
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

    >>> from trace_dag.osm.rights import OSM_ATTRIBUTION
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
