"""Reports in folders, recognised by their content and never by their file name.

A file that is not well-formed still gets its key, so that it can be registered and rejected with its reason instead
of being lost. A response without a case gets the key of the request it answers.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from lxml import etree

from trace_dag.common.errors import Rejection, UserError
from trace_dag.crash.fields import Fields
from trace_dag.crash.keys import crash_key
from trace_dag.crash.xml_input import MAX_REPORT_BYTES, local_name, parse_leniently, parse_untrusted, values_of

_CASE_YEAR: Final = re.compile(rb"<CaseYear>\s*([0-9]{4})\s*</CaseYear>")
_STATE_CASE: Final = re.compile(rb"<ST_CASE>\s*([0-9]{5,6})\s*</ST_CASE>")
_CRASH: Final = re.compile(rb"<CrashResultSet[\s>]")
_SEARCH: Final = re.compile(r"StateCase:\s*([0-9]{5,6})\D+CaseYear:\s*([0-9]{4})", re.IGNORECASE)
_HEAD_BYTES: Final = 16 * 1024
_COMPRESSED: Final = (b"\x1f\x8b", b"BZh", b"PK\x03\x04", b"7z\xbc\xaf")  # gzip, bzip2, zip, 7z


@dataclass(frozen=True)
class FoundReport:
    """A file with the report of one crash, or (``released`` False) with the answer that there is none yet."""

    key: str
    path: Path
    sha256: str
    released: bool = True


@dataclass(frozen=True)
class FurtherFile:
    """A further file about a crash; ``kept`` is the one that is read."""

    key: str
    kept: Path
    path: Path


@dataclass(frozen=True)
class Unrecognised:
    """A file that holds no report, and why."""

    path: Path
    why: str


@dataclass(frozen=True)
class FolderScan:
    """The files of the folders: reports in order of their keys, one per crash, and the files left aside.

    ``duplicates`` have the content of the report that is read, ``conflicts`` other content.
    """

    reports: tuple[FoundReport, ...]
    duplicates: tuple[FurtherFile, ...] = ()
    conflicts: tuple[FurtherFile, ...] = ()
    unrecognised: tuple[Unrecognised, ...] = ()


def scan(paths: Iterable[Path]) -> FolderScan:
    """Find every report in the given files and folders, with subfolders.

    Raises: UserError: for a path that does not exist or cannot be read.

    >>> scan([Path("no-such-folder")])
    Traceback (most recent call last):
    trace_dag.common.errors.UserError: no-such-folder does not exist; expected a folder or file of crash reports
    """
    by_key: dict[str, list[FoundReport]] = {}
    unrecognised: list[Unrecognised] = []
    for path in _files(map(Path, paths)):
        found = _look_at(path)
        if isinstance(found, Unrecognised):
            unrecognised.append(found)
        else:
            by_key.setdefault(found.key, []).append(found)
    reports: list[FoundReport] = []
    duplicates: list[FurtherFile] = []
    conflicts: list[FurtherFile] = []
    for key in sorted(by_key):
        best, *others = _best_first(by_key[key])
        reports.append(best)
        for other in others:
            if not other.released and best.released:
                continue  # an older answer, from before the case was released
            further = duplicates if _same_content(best, other) else conflicts
            further.append(FurtherFile(key, best.path, other.path))
    return FolderScan(tuple(reports), tuple(duplicates), tuple(conflicts), tuple(unrecognised))


def identify(data: bytes, *, name: str) -> tuple[str, bool] | None:
    """Return the crash key of a response and whether it has the case; None if it is no response.

    Raises :class:`Rejection` for data that must not be parsed (too large, with a document type).

    >>> identify(b"<CrashResultSet><CASEYEAR>2023</CASEYEAR><ST_CASE>510179</ST_CASE></CrashResultSet>", name="c.xml")
    ('2023-510179', True)
    """
    head = data[:_HEAD_BYTES]
    if _CRASH.search(head):
        year, case = _CASE_YEAR.search(head), _STATE_CASE.search(head)
        if year and case:
            return _key(year[1], case[1])
    root = parse_leniently(data, name=name)
    if root is None:
        return None
    if (crash := next(root.iter("{*}CrashResultSet"), None)) is not None:
        fields = Fields(values_of(crash), name)
        return _key(fields.text("CASEYEAR", "YEAR"), fields.text("ST_CASE"))
    if not local_name(root).startswith("ResponseOf"):
        return None
    search = _SEARCH.search(Fields(values_of(root), name).text("SEARCHCRITERIA"))
    found = _key(search[2], search[1]) if search else None
    return (found[0], False) if found else None


def _key(year: bytes | str, case: bytes | str) -> tuple[str, bool] | None:
    if not (year.isascii() and case.isascii()):
        return None  # int() would read the digits of any script
    try:
        return crash_key(int(year), int(case)), True
    except ValueError:
        return None


def _look_at(path: Path) -> FoundReport | Unrecognised:
    try:
        str(path).encode()
    except UnicodeEncodeError:
        shown = os.fsencode(path).decode(errors="backslashreplace")
        return Unrecognised(Path(shown), "its name is not UTF-8, by which it could not be stored; rename it")
    try:
        size = path.stat().st_size
        if size == 0:
            return Unrecognised(path, "it is empty")
        if size > MAX_REPORT_BYTES:
            return Unrecognised(
                path, f"it has {size / 1e6:.0f} MB; a report has at most {MAX_REPORT_BYTES / 1e6:.0f} MB"
            )
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
            if head.startswith(_COMPRESSED):
                return Unrecognised(path, "it is compressed; unpack it")
            if b"<" not in head:
                return Unrecognised(path, "it is not XML")
            data = head + file.read(MAX_REPORT_BYTES)
    except OSError as error:
        return Unrecognised(path, f"it cannot be read: {error.strerror or error}")
    try:
        found = identify(data, name=path.name)
    except Rejection as rejection:
        return Unrecognised(path, rejection.detail)
    if found is None:
        return Unrecognised(path, "it names no crash")
    key, released = found
    return FoundReport(key, path, hashlib.sha256(data).hexdigest(), released)


def _files(roots: Iterable[Path]) -> Iterator[Path]:
    seen: set[Path] = set()
    for root in roots:
        if not root.exists():
            raise UserError(f"{root} does not exist; expected a folder or file of crash reports")
        for path in sorted(_below(root)) if root.is_dir() else [root]:
            real = path.resolve()
            if real not in seen:
                seen.add(real)
                yield path


def _below(folder: Path) -> Iterator[Path]:
    def refuse(error: OSError) -> None:
        raise UserError(f"{error.filename} cannot be read: {error.strerror}") from error

    for parent, _, names in os.walk(folder, onerror=refuse):
        yield from (path for name in names if (path := Path(parent, name)).is_file())


def _best_first(reports: list[FoundReport]) -> list[FoundReport]:
    """Return the reports in reading order: those with the case first, well-formed before broken."""
    if len(reports) == 1:
        return reports
    return sorted(reports, key=lambda report: (not report.released, _content(report) is None))


def _same_content(first: FoundReport, second: FoundReport) -> bool:
    if first.sha256 == second.sha256:
        return True
    content = _content(first)
    return content is not None and content == _content(second)


def _content(report: FoundReport) -> str | None:
    """Return the content of a well-formed report without indentation; None if it is not well-formed."""
    try:
        root, _ = parse_untrusted(report.path.read_bytes(), name=report.path.name)
    except Rejection:
        return None
    for element in root.iter():
        element.text = " ".join((element.text or "").split())
        element.tail = None
    return etree.tostring(root, method="c14n").decode()
