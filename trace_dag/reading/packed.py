"""Crashes from packages and releases, without their root."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import io
import lzma
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol, TypeVar

from pydantic import BaseModel, ValidationError

from trace_dag.common.errors import DamagedFile, Failure, UserError
from trace_dag.common.schemas import table_from_parquet
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.keys import parse_key
from trace_dag.export.package import MANIFEST
from trace_dag.flow.artefacts import (
    ESTIMATE,
    EXTRACT,
    MAP_REPORT,
    RECORD,
    REPORT_JSON,
    REPORT_XML,
    ROAD_MAP,
    SAMPLED,
    VERDICT,
    VERDICT_JSON,
    XODR,
    Artefact,
    CrashArtefacts,
)
from trace_dag.reading.crashes import Crashes
from trace_dag.reading.untrusted import GET_AGAIN, MOST_BYTES, check_json, check_size
from trace_dag.verdict.types import EventResult

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

    from trace_dag.simulation.types import SimulationLog

T = TypeVar("T")

INDEX = "index.parquet"
_SAID = 200  # characters of what a library says
_ZIP = b"PK\x03\x04"
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_UNPACK: dict[bytes, Callable[[Any], Any]] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zX": lzma.open}
_FILES = {
    REPORT_XML: "report.xml",
    REPORT_JSON: "report.json",
    EXTRACT: "map.osm",
    XODR: "map.xodr",
    ROAD_MAP: "map.xodr",
    MAP_REPORT: "map_report.json",
    ESTIMATE: "states.json",
    SAMPLED: "intervals.json",
    VERDICT: "verdict.json",
    VERDICT_JSON: "verdict.json",
}
"""Which file of a package holds an artefact."""
_REPORTS = ("report.json", "report.xml")
_OF_THE_RECORD = (
    "register",
    "case_year",
    "state_case",
    "latitude_deg",
    "longitude_deg",
    "state_name",
    "month",
    "hour",
    "kind",
    "collision_type",
    "road_topology",
    "vehicle_trajectory",
    "fatalities",
    "severity",
    "trafficway_1",
    "trafficway_2",
)


class Files(Protocol):
    """Files below a folder or in an archive, by their names below its one top folder."""

    place: str

    def read(self, name: str) -> bytes:
        """Return the whole file.

        Raises ``FileNotFoundError``.
        """

    def has(self, name: str) -> bool:
        """Return whether the file exists."""


class FolderFiles:
    """The files below a folder."""

    def __init__(self, folder: Path) -> None:
        self.place = str(folder)
        self._folder = folder

    def read(self, name: str) -> bytes:
        if not self.has(name):
            raise FileNotFoundError(f"{self.place}: no {name}")
        check_size(f"{self.place}: {name}", (self._folder / name).stat().st_size)
        return (self._folder / name).read_bytes()

    def has(self, name: str) -> bool:
        return (self._folder / name).is_file()


class ArchiveFiles:
    """The files of a zip or tar archive, read into memory one at a time, up to a common size limit."""

    def __init__(self, place: str, archive: zipfile.ZipFile | tarfile.TarFile) -> None:
        self.place = place
        self._archive = archive
        self._members: dict[str, zipfile.ZipInfo | tarfile.TarInfo] = {}
        for member in archive.infolist() if isinstance(archive, zipfile.ZipFile) else archive:
            if isinstance(member, zipfile.ZipInfo):
                name, size, plain = member.filename, member.file_size, member.compress_type in _PACKED
            else:
                name, size, plain = member.name, member.size, member.isreg() and not member.issparse()
                if member.isdir():
                    continue
            if not plain:  # a link, a pipe, holes in place of data, or packed in a way that has no limit
                raise DamagedFile(f"{place}: {name}", "no plain file, stored or deflated", GET_AGAIN)
            check_size(f"{place}: {name}", size)  # before a packed tar is unpacked up to its next member
            self._members[name.partition("/")[2]] = member

    @classmethod
    def of(cls, data: Path | bytes, place: str) -> ArchiveFiles:
        """Return an archive on disk or in memory.

        Raises :class:`UserError` for any other file.
        """
        source = io.BytesIO(data) if isinstance(data, bytes) else data.open("rb")
        try:
            begins = source.read(len(_ZIP))
            source.seek(0)
            if begins == _ZIP:  # zipfile.is_zipfile takes a tar that ends with a package for that package
                return cls(place, zipfile.ZipFile(source))
            unpack = next((each for magic, each in _UNPACK.items() if begins.startswith(magic)), None)
            plain = source if unpack is None else unpack(source)
            return cls(place, tarfile.open(fileobj=_Bounded(plain, place), mode="r:"))  # type: ignore[call-overload]
        except (
            tarfile.TarError,
            zipfile.BadZipFile,
            NotImplementedError,
            EOFError,
            OSError,
            zlib.error,
            lzma.LZMAError,
        ) as error:
            raise UserError(
                f"{place}: neither a zip nor a tar archive ({error}); expected a package or a release"
            ) from error

    def read(self, name: str) -> bytes:
        """See :class:`Files`. Raises :class:`DamagedFile` for an archive that cannot be read on."""
        if name not in self._members:
            raise FileNotFoundError(f"{self.place}: no {name}")
        member = self._members[name]
        try:
            if isinstance(self._archive, zipfile.ZipFile):
                found: IO[bytes] | None = self._archive.open(member)  # type: ignore[arg-type] # of its own archive
            else:
                found = self._archive.extractfile(member)  # type: ignore[arg-type]
            data = found.read(MOST_BYTES + 1) if found is not None else None
        except (
            tarfile.TarError,
            zipfile.BadZipFile,
            zlib.error,
            lzma.LZMAError,
            RuntimeError,
            OSError,
            EOFError,
        ) as error:
            # RuntimeError is zipfile's for files with a password and, as NotImplementedError, for ways to pack that it
            # does not know.
            raise DamagedFile(f"{self.place}: {name}", f"cannot be read ({error})", GET_AGAIN) from error
        if data is None:
            raise FileNotFoundError(f"{self.place}: {name} is not a file")
        check_size(f"{self.place}: {name}", len(data))  # the archive's directory can say less
        return data

    def has(self, name: str) -> bool:
        return name in self._members


class _Bounded:
    """A file that is read in pieces of a limited size, because tarfile trusts the sizes in headers."""

    def __init__(self, file: IO[bytes], place: str) -> None:
        self.tell, self.seek = file.tell, file.seek
        self._file = file
        self._place = place

    def read(self, size: int) -> bytes:
        """Read some bytes. Raises :class:`DamagedFile` for more than the size limit."""
        check_size(self._place, size - 1)
        return self._file.read(size)


class _File(BaseModel):
    sha256: str


class _Manifest(BaseModel):
    key: str
    files: dict[str, _File]


class PackedCrash:
    """A crash of a package. Each file is checked against the package's manifest when it is read."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self._parsed: dict[str, Any] = {}

    @cached_property
    def _manifest(self) -> _Manifest:
        name, data = self._place(MANIFEST), self._files.read(MANIFEST)
        check_json(name, data)
        try:
            manifest = _Manifest.model_validate_json(data)
            parse_key(manifest.key)
        except (ValidationError, UserError) as error:
            raise DamagedFile(name, f"not a manifest of a package ({_said(error)})", GET_AGAIN) from error
        return manifest

    @property
    def key(self) -> str:
        """Return the crash's key."""
        return self._manifest.key

    def has(self, artefact: Artefact[Any]) -> bool:
        return self._name(artefact) in self._manifest.files

    def _name(self, artefact: Artefact[Any]) -> str:
        """Return the file of an artefact; for the record, the report from which it was read."""
        if artefact is RECORD:
            return next(name for name in _REPORTS if name in self._manifest.files or name == _REPORTS[-1])
        return _FILES.get(artefact, "")

    def load(self, artefact: Artefact[T]) -> T:
        """See :class:`trace_dag.flow.artefacts.CrashArtefacts`. Raises :class:`DamagedFile`."""
        from trace_dag.common.plugins import resolve_reference

        if not artefact.reader:
            return self._read(self._name(artefact))  # type: ignore[return-value] # an artefact without a reader is one of bytes
        found: T = self._once(artefact.reader, lambda: self._parse(artefact, resolve_reference(artefact.reader)))
        return found

    def _parse(self, artefact: Artefact[T], reader: Any) -> T:
        name = self._name(artefact)
        if artefact is RECORD:
            from trace_dag.common.settings import CrashSettings
            from trace_dag.crash.parse import read_report

            place = self._place(name)
            return read_report(self._read(name), name=place, settings=CrashSettings(), expected_key=self.key)  # type: ignore[return-value]
        if artefact is EXTRACT:  # as OSM XML, and nothing beside the roads
            from trace_dag.osm.xml import read_osm

            return read_osm(self._read(name), name=self._place(name))  # type: ignore[return-value]
        named = {"name": self._place(name)} if artefact.named else {}
        data = self._read(name)
        try:
            parsed: T = reader(data, **named)
        except (ValueError, Failure) as error:
            raise DamagedFile(self._place(name), f"not what a package holds ({_said(error)})", GET_AGAIN) from error
        return parsed

    def shown_log(self) -> SimulationLog:
        """See :class:`trace_dag.flow.artefacts.CrashArtefacts`; a package has one. Raises :class:`DamagedFile`."""
        from trace_dag.scenario.trajectories import log_from_json

        name = "trajectories.json"
        found: SimulationLog = self._once(name, lambda: log_from_json(self._read(name), name=self._place(name)))
        return found

    def _once(self, name: str, make: Any) -> Any:
        if name not in self._parsed:
            self._parsed[name] = make()
        return self._parsed[name]

    def _place(self, name: str) -> str:
        return f"{self._files.place}: {name}"

    def _read(self, name: str) -> bytes:
        said = self._manifest.files.get(name)
        try:
            data = self._files.read(name)
        except FileNotFoundError as error:
            raise DamagedFile(self._place(name), "it is not there", GET_AGAIN) from error
        if said is None or hashlib.sha256(data).hexdigest() != said.sha256:
            raise DamagedFile(self._place(name), "its content differs from the manifest", GET_AGAIN)
        if name.endswith(".json"):
            check_json(self._place(name), data)
        return data


class Package(Crashes):
    """The one crash of a scenario package."""

    def __init__(self, files: Files) -> None:
        super().__init__(files.place)
        self._crash = PackedCrash(files)

    @property
    def _keys(self) -> list[str]:
        return [self._crash.key]

    def _stored(self, key: str) -> CrashArtefacts:
        return self._crash

    @cached_property
    def crashes(self) -> pd.DataFrame:
        """Return a row of reported facts (place, time, kind, classes) and the verdict's figures.

        Columns are named as in a root.
        """
        import pandas as pd

        record, verdict = self.only.record, self.only.verdict
        row = {name: getattr(record, name) for name in _OF_THE_RECORD}
        row |= {
            "label": verdict.label.value,
            "grade": verdict.grade.value if verdict.grade else None,
            "contact_distance_m": verdict.worst("reported_distance"),
            "delta_v_max_mps": verdict.worst("delta_v"),
            "events_reported": len(verdict.events),
            "events_happened": sum(event.outcome is EventResult.HAPPENED for event in verdict.events),
        }
        return _with_mph(pd.DataFrame([row], index=pd.Index([record.key], name="key")))

    @cached_property
    def _connection(self) -> duckdb.DuckDBPyConnection:
        return _connection(self.crashes)


class Release(Crashes):
    """The crashes of a release, all verified. Each package is checked against the release's index when it is read."""

    def __init__(self, files: Files) -> None:
        super().__init__(files.place)
        self._files = files

    @cached_property
    def crashes(self) -> pd.DataFrame:
        """Return the index of the release: :data:`trace_dag.export.release_files.RELEASE_INDEX`, indexed by key."""
        import pyarrow as pa

        try:
            frame: pd.DataFrame = table_from_parquet(self._files.read(INDEX)).to_pandas()
            return _with_mph(frame.set_index("key"))
        except (pa.ArrowInvalid, KeyError, OSError) as error:
            raise DamagedFile(f"{self.place}: {INDEX}", f"not the index of a release ({error})", GET_AGAIN) from error

    @cached_property
    def _keys(self) -> list[str]:
        return list(self.crashes.index)

    def _stored(self, key: str) -> CrashArtefacts:
        row = self.crashes.loc[key]
        name = str(row["package"])
        try:
            data = self._files.read(name)
        except FileNotFoundError as error:
            raise DamagedFile(f"{self.place}: {name}", "it is not there", GET_AGAIN) from error
        if hashlib.sha256(data).hexdigest() != row["package_sha256"]:
            raise DamagedFile(f"{self.place}: {name}", "its content is not what the index says", GET_AGAIN)
        return PackedCrash(ArchiveFiles.of(data, f"{self.place}: {name}"))

    @cached_property
    def _connection(self) -> duckdb.DuckDBPyConnection:
        return _connection(self.crashes)


def list_packages(files: Files) -> Crashes | None:
    """Return the package or release that the files form, or None."""
    if files.has(MANIFEST):
        return Package(files)
    return Release(files) if files.has(INDEX) else None


def _with_mph(crashes: pd.DataFrame) -> pd.DataFrame:
    """Return the table with the change of velocity also in miles per hour, as in a root."""
    return crashes.assign(delta_v_max_mph=crashes["delta_v_max_mps"].map(mps_to_mph, na_action="ignore"))


def _connection(crashes: pd.DataFrame) -> duckdb.DuckDBPyConnection:
    """Return a database with one table, ``crashes``, and no access to anything else."""
    import duckdb

    connection = duckdb.connect(":memory:")
    connection.register("given", crashes.reset_index())
    connection.execute("CREATE TABLE crashes AS FROM given")
    connection.unregister("given")
    connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")
    return connection


def _said(error: Exception) -> str:
    """Return the first fault, in one line."""
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_input=False)[0]
        return f"{'.'.join(map(str, first['loc'])) or 'the document'}: {first['msg']}"[:_SAID]
    return " ".join(str(error).split())[:_SAID]
