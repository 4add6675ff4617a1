"""The tables of a FARS national release, as CSV files in a folder or a zip: found, decoded and read as text.

NHTSA's releases differ: file names in upper, lower and mixed case, at the root of the zip or in a folder, with and
without a byte order mark, in UTF-8 or Latin-1. All of these are read alike here. The meaning of the columns is the
subject of :mod:`trace_dag.crash.fars.csv_tables`."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from trace_dag.common.errors import UserError

if TYPE_CHECKING:
    import pyarrow as pa

TABLES: Final = (
    *("accident", "vehicle", "person", "cevent", "vevent", "vsoe", "damage", "maneuver"),
    *("pbtype", "nmprior", "nmcrash", "safetyeq", "parkwork", "vpicdecode", "weather", "violatn", "driverrf"),
)
"""The files that are read, by stem; further ones (drugs, race, ...) say nothing a reconstruction uses."""

LEADING: Final = ("accident", "cevent", "vevent", "vsoe")
"""Tables that tell of every crash of a release: each of them makes one."""
MAX_TABLE_BYTES: Final = 2 * 1024**3
"""The largest national file, person.csv with labels, has about 0.1 GB."""

_FOR_ONE_THREAD: Final = 2**20  # bytes: smaller tables are read before others have begun to help
_SHOWN: Final = 60  # characters of the names of columns
_YEAR_IN_NAME: Final = re.compile(r"(?<![0-9])(20[1-9][0-9])(?![0-9])")
_NAME: Final = re.compile(r"[A-Z_][A-Z0-9_]*")


@dataclass(frozen=True)
class CsvFile:
    """A CSV file on disk, or a member of a zip."""

    path: Path
    member: str | None = None

    @property
    def label(self) -> str:
        """Return its label for messages."""
        return f"{self.path}:{self.member}" if self.member else str(self.path)

    @property
    def folder(self) -> str:
        """Return the folder it lies in, which all tables of one release share."""
        inside = str(PurePosixPath(self.member).parent) if self.member else ""
        return f"{self.path if self.member else self.path.parent}:{inside}"

    def read(self) -> bytes:
        """Return the bytes.

        Raises UserError if they cannot be read or exceed the limit.
        """
        try:
            if self.member is None:
                _check_size(self.label, self.path.stat().st_size)
                return self.path.read_bytes()
            with zipfile.ZipFile(self.path) as archive:
                _check_size(self.label, archive.getinfo(self.member).file_size)
                return archive.read(self.member)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
            raise UserError(f"{self.label} cannot be read: {error}") from error


@dataclass(frozen=True)
class FarsRelease:
    """The tables of one release: a folder's files by lower-case stem, and the year its path names, if any."""

    files: dict[str, CsvFile] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Return its label for messages."""
        return self._leading.label

    @property
    def _leading(self) -> CsvFile:
        return next(self.files[name] for name in LEADING if name in self.files)

    @property
    def year_in_path(self) -> int | None:
        """Return the year in the names of file, folder or zip, last one first."""
        file = self._leading
        years = _YEAR_IN_NAME.findall(str(PurePosixPath(file.path.as_posix()) / (file.member or "")))
        return int(years[-1]) if years else None

    def table(self, name: str) -> pa.Table | None:
        """Return a table with upper-case column names and text values, or None if the release lacks the file."""
        file = self.files.get(name)
        return None if file is None else _read_table(file)


def find_releases(path: Path) -> tuple[FarsRelease, ...]:
    """Return every release at a path.

    The path is a folder (searched to the bottom, zips included), a zip, or one CSV file, which stands for its folder.

    A release may lack tables. Raises UserError if none lists every crash.

    >>> find_releases(Path("no-such-folder"))
    Traceback (most recent call last):
    trace_dag.common.errors.UserError: no-such-folder does not exist; expected a folder or zip of FARS CSV files
    """
    if not path.exists():
        raise UserError(f"{path} does not exist; expected a folder or zip of FARS CSV files")
    folders: dict[str, dict[str, CsvFile]] = {}
    for file in _csv_files(path):
        stem = PurePosixPath(file.member or file.path.as_posix()).stem.lower()
        if stem in TABLES:
            folders.setdefault(file.folder, {}).setdefault(stem, file)
    releases = tuple(
        FarsRelease(files) for _, files in sorted(folders.items()) if any(name in files for name in LEADING)
    )
    if not releases:
        raise UserError(f"{path}: no accident.csv found; expected the files of a FARS national release")
    return releases


def _read_table(file: CsvFile) -> pa.Table:
    """Return a CSV file as text columns with upper-case names.

    Raises UserError that names the file and its fault.
    """
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    data = file.read()
    header = data[: data.find(b"\n") + 1 or len(data)].decode("latin-1").removeprefix("\xef\xbb\xbf")
    try:
        names = [name.strip().upper() for name in next(csv.reader(io.StringIO(header)), [])]
    except csv.Error as error:  # a carriage return within the line, for example
        raise UserError(f"{file.label} is not a readable CSV table: its first line: {error}") from error
    if "ST_CASE" not in names:
        found = ", ".join(names[:5])
        shown = found if len(found) <= _SHOWN else f"{found[:_SHOWN]}..."
        raise UserError(f"{file.label}: no ST_CASE among its columns ({shown}); expected FARS CSV, with commas between")
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1 and _NAME.fullmatch(name)]
    if twice:
        raise UserError(f"{file.label}: column {twice[0]} is there more than once; expected FARS CSV")
    problem: Exception | None = None
    # Files that are not UTF-8 come from Windows; the few bytes its code page lacks leave Latin-1.
    for encoding in ("utf-8", "cp1252", "latin-1"):
        try:
            table = arrow_csv.read_csv(
                io.BytesIO(data),
                read_options=arrow_csv.ReadOptions(
                    encoding=encoding, column_names=names, skip_rows=1, use_threads=len(data) > _FOR_ONE_THREAD
                ),
                convert_options=arrow_csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
            )
            return table.select([name for name in dict.fromkeys(names) if _NAME.fullmatch(name)])
        except (pa.ArrowInvalid, pa.ArrowKeyError, UnicodeDecodeError) as error:
            problem = error
    raise UserError(f"{file.label} is not a readable CSV table: {problem}")


def _csv_files(path: Path) -> Iterator[CsvFile]:
    if path.is_dir():
        for child in sorted(path.rglob("*")):
            if child.is_file() and child.suffix.lower() in (".csv", ".zip"):
                yield from _csv_files(child)
    elif path.suffix.lower() == ".zip":
        try:
            with zipfile.ZipFile(path) as archive:
                members = sorted(name for name in archive.namelist() if name.lower().endswith(".csv"))
        except (OSError, zipfile.BadZipFile) as error:
            raise UserError(f"{path} is not a readable zip: {error}") from error
        yield from (CsvFile(path, member) for member in members)
    elif path.suffix.lower() == ".csv":
        yield CsvFile(path)


def _check_size(label: str, size_bytes: int) -> None:
    if size_bytes > MAX_TABLE_BYTES:
        raise UserError(
            f"{label} has {size_bytes / 1e9:.1f} GB; a national table has at most {MAX_TABLE_BYTES / 1e9:.1f}"
        )
