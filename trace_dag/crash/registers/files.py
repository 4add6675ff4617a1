"""Files of crash tables as programs save them: text in several encodings, compressed or not."""

from __future__ import annotations

import codecs
import csv
import shutil
from itertools import islice
from pathlib import Path
from typing import Any, Final

from trace_dag.common.errors import UserError

_SEPARATORS: Final = ",;\t|"
_NOT_TABLES: Final = {
    b"PK\x03\x04": "an Excel workbook or a zip archive: save the sheet as CSV, or unpack the archive",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save the sheet as CSV",
    b"{": "JSON: save it as CSV with a column of latitudes and one of longitudes",
    b"[": "JSON: save it as CSV with a column of latitudes and one of longitudes",
    b"PAR1": "Parquet: save it as CSV",
}


def _windows_1252(error: UnicodeError) -> str:
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("cp1252", "replace")


def read_header(path: Path, separator: str | None) -> tuple[list[str], str]:
    """Return the columns of a table and their separator, which is detected if not given."""
    with _opened(path) as file:
        line = file.readline()
    found = separator or max(_SEPARATORS, key=line.count)
    header = next(csv.reader([line.lstrip("\ufeff").rstrip("\r\n")], delimiter=found), [])
    if not any(header):
        raise UserError(f"{path} cannot be read as a CSV table: it begins with a blank line; expected its columns")
    return header, found


def copy_as_utf8(path: Path, copy: Path) -> Path:
    """Write a table's text as UTF-8; return the copy."""
    with _opened(path) as file, copy.open("w", encoding="utf-8", newline="") as target:
        shutil.copyfileobj(file, target, 1 << 20)
    return copy


def _opened(path: Path) -> Any:
    """Open a table as text: UTF-8, UTF-16 or Windows-1252, also compressed as .gz, .bz2 or .xz."""
    import fsspec

    try:
        with fsspec.open(str(path), "rb", compression="infer") as file:
            begins = file.read(4)
        if what := next((said for magic, said in _NOT_TABLES.items() if begins.startswith(magic)), None):
            raise UserError(f"{path} is not a CSV table; it is {what}")
        utf16 = begins.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return fsspec.open(
            str(path),
            "rt",
            compression="infer",
            encoding="utf-16" if utf16 else "utf-8-sig",
            errors="windows-1252",
            newline="",
        ).open()
    except OSError as error:
        raise UserError(f"{path} cannot be read as a CSV table: {error}") from error


codecs.register_error("windows-1252", lambda error: (_windows_1252(error), getattr(error, "end", 0)))


def first_rows(path: Path, most: int) -> tuple[list[str], list[list[str]]]:
    """Return the columns of a table and its first rows."""
    header, separator = read_header(path, None)
    with _opened(path) as file:
        reader = csv.reader(file, delimiter=separator)
        return header, [row for row in islice(reader, 1, most + 1) if row]
