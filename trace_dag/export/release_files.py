"""Files beside the packages of a benchmark release: index, datasheet, checksums, citation, and its archive.

A release is a folder ``trace-dag-benchmark-<version>``: ``packages/<key>.zip``, ``index.parquet`` and ``index.json``
with a row per package, ``README.md`` (with the head of a data set card), ``PROTOCOL.md``, ``croissant.json``,
``datacite.json``, ``DATASHEET.md`` (after Gebru et al., Datasheets for Datasets, CACM 64(12), 2021), ``LICENSES.md``,
``CITATION.cff`` and ``SHA256SUMS`` over all of them. The same crashes give the same bytes. Belongs here: the contents
of these files. Does not belong here: collecting it (:mod:`trace_dag.export.release`).
"""

from __future__ import annotations

import json
import statistics
import tarfile
import zipfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from trace_dag.agents.evaluation.splits import SITE_M, Split
from trace_dag.common.errors import Reason
from trace_dag.common.messages.wording import count_of
from trace_dag.common.schemas import TableSchema
from trace_dag.crash.classes import CollisionType, CrashKind, RoadTopology, VehicleTrajectory
from trace_dag.crash.keys import FARS
from trace_dag.export.documents import render_document
from trace_dag.export.geoparquet import geoparquet
from trace_dag.export.release_metadata import croissant, datacite, licences
from trace_dag.osm.types import Rights
from trace_dag.verdict.types import Grade
from trace_dag.version import __version__

NAME = "trace-dag-benchmark"
CHECKSUMS = "SHA256SUMS"

ArchiveFormat = Literal["tar", "zip"]
Row = Mapping[str, Any]

RELEASE_INDEX = TableSchema.of_csv("trace_dag.export", "release_index", "One row per scenario package of a release")

_CLASSES: Mapping[str, type[StrEnum]] = {
    "collision_type": CollisionType,
    "road_topology": RoadTopology,
    "vehicle_trajectory": VehicleTrajectory,
}
_MOVERS = {
    CrashKind.PEDESTRIAN: "pedestrians",
    CrashKind.CYCLIST: "cyclists and others on conveyances",
    CrashKind.ANIMAL: "animals",
}
_EVENT_COUNTS = ("events_reported", "events_happened", "events_not_modelled")
_THOUSAND = 1000
_EPOCH_S = 315532800  # 1980-01-01, the first date a zip archive knows


@dataclass(frozen=True, eq=False)
class BenchmarkRelease:
    """The contents of a release.

    ``crashes`` are the rows of all registered crashes of the ``cohorts``, verified or not (warehouse table
    ``crashes``), ``packages`` rows with the columns of :data:`RELEASE_INDEX`.

    ``made_on`` is the day on which the newest of them was verified, in ISO 8601.
    """

    version: str
    made_on: str
    cohorts: Sequence[str]
    crashes: Sequence[Row]
    packages: Sequence[Row]

    @property
    def name(self) -> str:
        """Return the name of its folder and archive."""
        return f"{NAME}-{self.version}"

    @property
    def rights(self) -> Rights:
        """Return the rights in the maps of all packages together."""
        return Rights.of(str(row["map_attribution"]) for row in self.packages)


def release_documents(release: BenchmarkRelease) -> dict[str, bytes]:
    """Return the files beside the packages by name, all but the checksums.

    >>> from trace_dag.osm.types import OSM_ATTRIBUTION
    >>> row = dict.fromkeys(column.name for column in RELEASE_INDEX.columns)
    >>> row |= {"key": "2023-510001", "map_attribution": OSM_ATTRIBUTION, "latitude_deg": 37.0, "longitude_deg": -78.0}
    >>> row["case_year"] = 2023
    >>> row |= {"split": "train", "package": "packages/2023-510001.zip", "package_bytes": 1, "package_sha256": ""}
    >>> files = release_documents(BenchmarkRelease("1.0", "2026-01-31", ["va-2023"], [], [row]))
    >>> b"2023-510001" in files["index.json"], b"ODbL" in files["LICENSES.md"]
    (True, True)
    """
    index = _index_parquet(release)
    return {
        "README.md": _card(release) + _rendered("release_readme.md.jinja", release),
        "PROTOCOL.md": _rendered("release_protocol.md.jinja", release),
        "DATASHEET.md": _rendered("release_datasheet.md.jinja", release),
        "CITATION.cff": _rendered("release_citation.cff.jinja", release),
        "LICENSES.md": render_document(
            "licenses.md.jinja", rights=release.rights, inferred=True, **_registers(release)
        ),
        "index.json": _index_json(release),
        "index.parquet": index,
        "croissant.json": croissant(
            NAME, release.version, release.made_on, _about(release), release.rights, RELEASE_INDEX, index
        ),
        "datacite.json": datacite(
            NAME,
            release.version,
            release.made_on,
            f"{NAME}: crashes reconstructed from police reports, as scenarios",
            _about(release),
            release.rights,
            _box_deg(release),
        ),
    }


def _registers(release: BenchmarkRelease) -> dict[str, Any]:
    """Return the registers of the reports for the documents, and whether FARS is among them."""
    return {
        "registers": sorted({row["attribution"] for row in release.packages if row.get("attribution")}),
        "fars": any(row.get("register") in (None, FARS) for row in release.packages),
    }


def checksums(sha256_by_name: Mapping[str, str]) -> bytes:
    """Return ``SHA256SUMS`` as ``sha256sum --check`` reads it.

    >>> checksums({"b.zip": "22", "a.zip": "11"})
    b'11  a.zip\\n22  b.zip\\n'
    """
    return "".join(f"{sha256}  {name}\n" for name, sha256 in sorted(sha256_by_name.items())).encode()


def read_checksums(data: bytes) -> dict[str, str]:
    """Return the SHA-256 by name of a ``SHA256SUMS``.

    >>> read_checksums(b"11  a.zip\\n22  b.zip\\n")
    {'a.zip': '11', 'b.zip': '22'}
    """
    lines = (line.split("  ", 1) for line in data.decode().splitlines() if line)
    return {name: sha256 for sha256, name in lines}


def write_archive(folder: Path, names: Iterable[str], target: Path, archive_format: ArchiveFormat) -> None:
    """Write an archive of a release's files, one file in memory at a time; equal files give equal bytes.

    Packages are compressed already, so the archive stores them unchanged.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as made:
    ...     _ = (Path(made) / "README.md").write_bytes(b"about this")
    ...     write_archive(Path(made), ["README.md"], Path(made) / "release.zip", "zip")
    ...     [name.split("/")[1] for name in zipfile.ZipFile(Path(made) / "release.zip").namelist()]
    ['README.md']
    """
    if archive_format == "tar":
        with tarfile.open(target, "w", format=tarfile.USTAR_FORMAT) as tar:
            for name in sorted(names):
                entry = tarfile.TarInfo(f"{folder.name}/{name}")
                entry.size, entry.mtime, entry.mode = (folder / name).stat().st_size, _EPOCH_S, 0o644
                with (folder / name).open("rb") as content:
                    tar.addfile(entry, content)
        return
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(names):
            stored = zipfile.ZipInfo(f"{folder.name}/{name}")  # dated 1980-01-01
            stored.create_system, stored.external_attr = 3, 0o644 << 16
            archive.writestr(stored, (folder / name).read_bytes())


# --- documents ---------------------------------------------------------------------------------------------------
def _card(release: BenchmarkRelease) -> bytes:
    """Return the head of a data set card, in the form of the Hugging Face hub, for the README."""
    names = [each.rpartition("/")[2].lower() for each in licences(release.rights)]
    lines = [
        "---",
        f"pretty_name: {NAME} {release.version}",
        f"license: {names[0] if len(names) == 1 else 'other'}",
        *([] if len(names) == 1 else [f"license_name: {'-and-'.join(names)}", "license_link: LICENSES.md"]),
        "language: [en]",
        "tags: [automated-driving, crash-reconstruction, openscenario, opendrive, fars, croissant]",
        f"size_categories: [{'n<1K' if len(release.packages) < _THOUSAND else '1K<n<10K'}]",
        "configs:",
        "  - config_name: crashes",
        "    data_files: index.parquet",
        "---",
        "",
        "",
    ]
    return "\n".join(lines).encode()


def _about(release: BenchmarkRelease) -> str:
    what = "fictional" if release.rights.fictional else "police-reported"
    crashes = count_of(len(release.packages), f"{what} crash", f"{what} crashes")
    return (
        f"{crashes}, each with its report, an OpenDRIVE map of the road, the simulated "
        "motion of everybody, OpenSCENARIO files and the verdict by which it agrees with the report; split by place "
        "for training, validation and test."
    )


def _box_deg(release: BenchmarkRelease) -> tuple[float, float, float, float]:
    """Return the west, south, east and north of the crashes."""
    places = [(float(row["longitude_deg"]), float(row["latitude_deg"])) for row in release.packages]
    east_west, north_south = zip(*places, strict=True)
    return min(east_west), min(north_south), max(east_west), max(north_south)


def _index_json(release: BenchmarkRelease) -> bytes:
    content = {
        "name": NAME,
        "version": release.version,
        "made_by": f"trace-dag {__version__}",
        "columns": RELEASE_INDEX.dictionary(),
        "packages": [{column.name: row[column.name] for column in RELEASE_INDEX.columns} for row in release.packages],
    }
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


def _index_parquet(release: BenchmarkRelease) -> bytes:
    import pyarrow as pa

    return geoparquet(pa.Table.from_pylist(list(release.packages), schema=RELEASE_INDEX.arrow()))


def _rendered(template: str, release: BenchmarkRelease) -> bytes:
    packed = {row["kind"] for row in release.packages}
    return render_document(
        template,
        release=release,
        rights=release.rights,
        name=NAME,
        made_by=f"trace-dag {__version__}",
        **_registers(release),
        columns=RELEASE_INDEX.dictionary(),
        classes={name: _by_class(release, name, values) for name, values in _CLASSES.items()},
        kinds=_kinds(release),
        movers=["motor vehicles", *(words for kind, words in _MOVERS.items() if kind in packed)],
        trailers=any("trailer" in str(row["vehicle_classes"] or "") for row in release.packages),
        **{name: sum(int(row[name] or 0) for row in release.packages) for name in _EVENT_COUNTS},
        states=Counter(str(crash["final_state"]) for crash in release.crashes),
        reasons=_reasons(release),
        figures=_figures(release),
        years=sorted({int(row["case_year"]) for row in release.packages}),
        places=Counter(str(row["state_name"] or "unknown") for row in release.packages).most_common(),
        bodies=Counter(
            body for row in release.packages for body in str(row["vehicle_classes"] or "").split(", ") if body
        ).most_common(),
        rule_sets=Counter(str(row["rule_set"]) for row in release.packages).most_common(),
        estimators=Counter(_estimator(row) for row in release.packages).most_common(),
        backends=Counter(str(row["backend"]) for row in release.packages).most_common(),
        speeds_reported=sum(int(row["speeds_reported"] or 0) for row in release.packages),
        splits=[(each.value, sum(row["split"] == each for row in release.packages)) for each in Split],
        site_m=SITE_M,
        megabytes=sum(int(row["package_bytes"]) for row in release.packages) / 1e6,
    )


def _estimator(row: Row) -> str:
    made, asked = row["estimator"], row["asked_estimator"]
    return str(made) if made == asked else f"{made} in place of {asked}"


def _kinds(release: BenchmarkRelease) -> list[tuple[str, int, int, int]]:
    """Return each kind of crash with the numbers of registered, packed and corroborated crashes."""
    registered = Counter(crash["kind"] for crash in release.crashes)
    packed = Counter(row["kind"] for row in release.packages)
    sure = Counter(row["kind"] for row in release.packages if row["grade"] == Grade.CORROBORATED)
    counts = [(kind.value, registered[kind], packed[kind], sure[kind]) for kind in CrashKind]
    return [each for each in counts if each[1] or each[2]]


def _by_class(release: BenchmarkRelease, name: str, values: type[StrEnum]) -> list[tuple[str, int, int]]:
    """Return each class that occurs with the numbers of registered and packed crashes."""
    registered = Counter(crash[name] for crash in release.crashes)
    packed = Counter(row[name] for row in release.packages)
    return [(each.value, registered[each.value], packed[each.value]) for each in values if registered[each.value]]


def _reasons(release: BenchmarkRelease) -> list[tuple[str, str, int]]:
    """Return the reasons for rejections: stage, reason, number of crashes."""
    rejected = Counter(crash["reason"] for crash in release.crashes if crash["final_state"] == "rejected")
    return [(reason.stage.value, reason.value, rejected[reason.value]) for reason in Reason if rejected[reason.value]]


def _figures(release: BenchmarkRelease) -> list[tuple[str, str, int, float, float, float]]:
    """Return figures of the scenarios: column, unit, number of values, least, median and largest."""
    rows = []
    for column in RELEASE_INDEX.columns:
        if column.unit in ("m", "h", "mps") or column.name.endswith("_rel"):
            known = [float(row[column.name]) for row in release.packages if row[column.name] is not None]
            if known:
                rows.append((column.meaning, column.unit, len(known), min(known), statistics.median(known), max(known)))
    return rows
