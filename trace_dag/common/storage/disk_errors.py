"""Errors of a full, broken or foreign disk, each as one sentence with its remedy.

A command ends with that one line, whichever library raised the error: Python, SQLite below Dagster, DuckDB or Arrow.
Does not belong here: files that can be read and are not as they were written
(:class:`trace_dag.common.errors.DamagedFile`).
"""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from trace_dag.common.errors import Failure

_SPACE = "free some space and run again"
_RIGHTS = "give this user the rights to it, or choose another folder"
_READ_ONLY = "make it writable, or choose another folder"
_REMEDIES = {
    errno.ENOSPC: _SPACE,
    errno.EDQUOT: _SPACE,
    errno.EFBIG: "raise the limit on the size of files (ulimit -f) and run again",
    errno.EROFS: _READ_ONLY,
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.EIO: "check the disk, and run again",
    errno.EISDIR: "remove the folder that is in its place and run again",
    errno.EMFILE: "raise the limit on open files (ulimit -n) and run again",
    errno.ENFILE: "end other programs that hold files open, and run again",
}
# https://www.sqlite.org/rescode.html
_SQLITE = {
    sqlite3.SQLITE_FULL: ("no space left on its disk", _SPACE),
    sqlite3.SQLITE_BUSY: ("another program has locked it", "end that program, or wait for it, and run again"),
    sqlite3.SQLITE_READONLY: ("it can be read only", _READ_ONLY),
    sqlite3.SQLITE_CANTOPEN: ("it cannot be opened", _RIGHTS),
    sqlite3.SQLITE_PERM: ("it cannot be opened", _RIGHTS),
    # Also of a disk without a free byte, where the file that its processes share cannot be made.
    sqlite3.SQLITE_IOERR: ("reading or writing it failed", "see whether its disk is full or broken, and run again"),
}


def remedy_of(error: OSError) -> str:
    """Return the remedy of an error of a disk.

    >>> remedy_of(OSError(errno.ENOSPC, "No space left on device"))
    'free some space and run again'
    """
    return _REMEDIES.get(error.errno or 0, "check the disk and permissions and run again")


def disk_failure(error: BaseException, database: str = "a database") -> Failure | None:
    """Return the failure to report if a disk caused ``error``, directly or indirectly; else None.

    ``database`` names the SQLite file, because SQLite's errors do not.
    """
    for each in _with_causes(error):
        if isinstance(each, OSError) and each.errno in _REMEDIES:
            where = f"{os.fsdecode(each.filename)}: " if isinstance(each.filename, str | bytes) else ""
            return Failure(f"{where}{each.strerror}; {remedy_of(each)}")
        if isinstance(each, sqlite3.Error):
            code = getattr(each, "sqlite_errorcode", 0) & 0xFF  # extended codes begin with the primary one
            if code in _SQLITE:
                found, remedy = _SQLITE[code]
                return Failure(f"{database}: {found}; {remedy}")
        if type(each).__module__.partition(".")[0] in ("duckdb", "_duckdb", "pyarrow"):
            for number, remedy in _REMEDIES.items():
                if os.strerror(number) in str(each):
                    return Failure(f"{str(each).splitlines()[0]}; {remedy}")
    return None


@contextmanager
def name_file_in_errors(path: Path) -> Iterator[None]:
    """Add the file's name to disk errors, which lack it when writing to an open file."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def _with_causes(error: BaseException) -> Iterator[BaseException]:
    seen: set[int] = set()
    found: BaseException | None = error
    while found is not None and id(found) not in seen:
        seen.add(id(found))
        yield found
        found = getattr(found, "orig", None) or found.__cause__ or found.__context__
