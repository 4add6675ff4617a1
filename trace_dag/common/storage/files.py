"""The storage root: one folder, local or on an object store, that holds everything the project makes.

Belongs here: reading, writing and listing named files below one root, on any fsspec location. Does not belong here:
what the files mean (:mod:`trace_dag.common.provenance`, :mod:`trace_dag.flow`).

Every write is atomic: locally into a temporary file of the same folder that is then renamed, on an object store as one
put. A process killed at any moment leaves at most an orphaned temporary file, never half an artefact. Whole cohorts are
read without a request per file: :meth:`Storage.list`, :meth:`Storage.sizes` and :meth:`Storage.read_many` cost one
listing, or requests that run concurrently.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from trace_dag.common.errors import DamagedFile, Failure, TransientFailure, UserError
from trace_dag.common.processes import is_abandoned, temporary_prefix
from trace_dag.common.storage.disk_errors import remedy_of

T = TypeVar("T")

LOCAL_FOLDER_VARIABLE = "TRACE_DAG_LOCAL_FOLDER"
"""Names the folder that holds, for each root on an object store, what must be local."""
_SAFE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*(/[A-Za-z0-9_][A-Za-z0-9._-]*)*")
_NOT_IN_URLS = re.compile(r"\?|%[0-9A-Fa-f]{2}")
_TEMPORARY = ".writing-"
_REMOTE_ATTEMPTS = 4
_READ_CONCURRENTLY = 16
_ASKED_ONE_BY_ONE = 20  # files of one folder; for more, a listing is cheaper
_NO_CREDENTIALS = ("NoCredentialsError", "PartialCredentialsError")  # botocore's, which may not be installed
_MD5 = re.compile(r"[0-9a-f]{32}")
_REMOTE_FIRST_WAIT_S = 0.25
# What is wrong with one file alone: no right to it, a bad sector, a folder or a circle of links in its place.
_OF_ONE_FILE = (errno.EACCES, errno.EPERM, errno.EIO, errno.EISDIR, errno.ELOOP)


@dataclass(frozen=True)
class StoredFile:
    """A file as it was written: its name below the root, size in bytes and SHA-256 (hexadecimal)."""

    name: str
    size: int
    sha256: str

    def matches(self, data: bytes) -> bool:
        """Return whether ``data`` equals the written content."""
        return len(data) == self.size and hashlib.sha256(data).hexdigest() == self.sha256


class Entry(NamedTuple):
    """A file as listed: size in bytes, and a token that changes whenever the file is replaced.

    ``md5`` (hexadecimal) of the content, if the object store reports it.
    """

    size: int
    version: str
    md5: str | None = None


def check_name(name: str) -> str:
    """Return ``name`` if it is a plain relative path of letters, digits, ``._-`` and ``/``; else raise ``ValueError``.

    No part may begin with a dot or a dash, so that no name leads out of the root, is hidden, or reads as an option.

    >>> check_name("verdict/2023-319003.json")
    'verdict/2023-319003.json'
    """
    if not _SAFE_NAME.fullmatch(name):
        raise ValueError(f"unsafe name in storage: {name!r} (letters, digits, '.', '_', '-' and '/' only)")
    return name


@contextmanager
def writable_folder(folder: Path) -> Iterator[Path]:
    """Yield the folder, or a temporary copy if it is read-only, because SQLite writes even to read."""
    there = next(each for each in (folder, *folder.parents) if each.exists())
    if os.access(there, os.W_OK):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as temporary:
        copy = Path(temporary) / folder.name
        if folder.is_dir():
            shutil.copytree(folder, copy, copy_function=shutil.copyfile)
            for each in (copy, *copy.rglob("*")):
                each.chmod(0o700)
        yield copy


class Storage:
    """Files below one root. ``root`` is a path or any fsspec URL (``s3://bucket/folder``, ``memory://x``, ...).

    Picklable: a worker opens its own connection. Errors: ``FileNotFoundError`` for a missing file, :class:`DamagedFile`
    for a local file that cannot be read, :class:`TransientFailure` where an object store did not answer after several
    attempts, :class:`Failure` for a full or broken disk.
    """

    def __init__(self, root: str | os.PathLike[str], options: Mapping[str, Any] | None = None) -> None:
        text = os.fspath(root)
        self._options = dict(options or {})
        self.local_root: Path | None = None
        if "://" not in text or text.startswith("file://"):
            self.local_root = Path(text.removeprefix("file://")).expanduser().absolute()
            text = str(self.local_root)
        self.root = text.rstrip("/") or "/"

    @property
    def local_folder(self) -> Path:
        """Return the local folder of this root: the root itself if it is local.

        Otherwise it lies below ``TRACE_DAG_LOCAL_FOLDER``, or below the user's folder for application data.
        """
        if self.local_root is not None:
            return self.local_root
        if chosen := os.environ.get(LOCAL_FOLDER_VARIABLE):
            base = Path(chosen).expanduser()
        else:
            base = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share") / "trace-dag"
        return base / hashlib.sha256(self.root.encode()).hexdigest()[:16]

    @classmethod
    def open(cls, root: str | os.PathLike[str], *, to_read: bool = False, output: bool = False) -> Storage:
        """Return the storage at ``root``, made if missing, after a check that it can be read and written.

        With ``to_read`` it has to exist, and reading is enough; ``output``: it is a folder for results, no root. Raises
        :class:`UserError` otherwise.
        """
        storage = cls(root)
        if storage.local_root is None and "://" not in storage.root:
            raise UserError(f"storage root {root}: names no bucket or folder, as in s3://bucket/folder")
        if storage.local_root is not None and not output and (found := _NOT_IN_URLS.search(storage.root)):
            raise UserError(
                f"storage root {storage.root}: {found[0]!r} means something else in the URLs by which SQLite opens "
                "Dagster's records; rename the folder, or choose another with --root or TRACE_DAG_ROOT"
            )
        probe = "probe/writable"
        try:
            if to_read and not storage._is_there():
                raise UserError(
                    f"storage root {storage.root}: there is nothing there; trace-dag ingest or trace-dag demo begins "
                    "one, --root or TRACE_DAG_ROOT names another"
                )
            if storage.local_root is not None:
                if not to_read:
                    storage.local_root.mkdir(parents=True, exist_ok=True)
                    with tempfile.TemporaryFile(dir=storage.local_root):
                        pass
                os.scandir(storage.local_root).close()
            elif not to_read:
                storage.write(probe, b"")
                storage.delete(probe)
        except (OSError, Failure, ImportError, ValueError) as error:
            what = "read" if to_read else "read and write"
            named = "output" if output else "storage root"
            remedy = "choose another" if output else "copy it, or choose another with --root or TRACE_DAG_ROOT"
            raise UserError(
                f"{named} {storage.root}: cannot {what} there ({error}); give this user the rights to it, {remedy}"
            ) from error
        return storage

    def _is_there(self) -> bool:
        if self.local_root is not None:
            try:
                self.local_root.stat()
            except FileNotFoundError:
                return False
            return True
        return bool(_remotely(lambda: self._filesystem.exists(self.root), self.root))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_filesystem"}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Storage) and (self.root, self._options) == (other.root, other._options)

    def __hash__(self) -> int:
        return hash(self.root)

    def __repr__(self) -> str:
        return f"Storage({self.root!r})"

    @cached_property
    def _filesystem(self) -> Any:
        import fsspec

        options = {"use_listings_cache": False, **self._options}
        if self.root.startswith("s3"):
            # Files are read in one piece: s3fs would ask for the size of each before it reads it, a request more.
            options.setdefault("max_concurrency", 1)
        return fsspec.core.url_to_fs(self.root, **options)[0]

    def path(self, name: str) -> str:
        """Return the path or URL of a file."""
        return f"{self.root}/{check_name(name)}"

    # --- one file --------------------------------------------------------------------------------------------
    def read(self, name: str) -> bytes:
        """Return the whole file."""
        path = self.path(name)
        if self.local_root is not None:
            return _on_disk(lambda: _contents_of(path, name), path)
        return bytes(_remotely(lambda: self._filesystem.cat_file(path), path))

    def read_whole(self, file: StoredFile) -> bytes:
        """Return the content of a file after comparing it with its digest.

        Raises :class:`DamagedFile`.
        """
        found = ""
        for _ in range(2):  # what was cut short on its way is whole the second time
            try:
                data = self.read(file.name)
            except FileNotFoundError as error:
                raise DamagedFile(file.name, "it is not there") from error
            if file.matches(data):
                return data
            found = f"{len(data)} bytes with SHA-256 {hashlib.sha256(data).hexdigest()[:12]}"
        raise DamagedFile(file.name, f"it has {found}, written were {file.size} bytes with {file.sha256[:12]}")

    def write(self, name: str, data: bytes) -> StoredFile:
        """Write ``data`` in one step, replacing an existing file."""
        path = self.path(name)
        if self.local_root is not None:
            _on_disk(lambda: _write_beside_and_rename(Path(path), data), path)
        else:
            _remotely(lambda: self._filesystem.pipe_file(path, data), path)
        return StoredFile(name, len(data), hashlib.sha256(data).hexdigest())

    def delete(self, name: str) -> None:
        """Delete the file, if it exists."""
        path = self.path(name)
        if self.local_root is not None:
            _on_disk(lambda: Path(path).unlink(missing_ok=True), path)
            return
        try:
            _remotely(lambda: self._filesystem.rm_file(path), path)
        except FileNotFoundError:
            return

    def move(self, name: str, to: str) -> None:
        """Rename a file, replacing an existing one; do nothing if it is missing.

        On a local root this also moves a folder that is in the file's place.
        """
        if self.local_root is not None:
            source, target = Path(self.path(name)), Path(self.path(to))
            if os.path.lexists(source):
                _on_disk(lambda: target.parent.mkdir(parents=True, exist_ok=True), str(target))
                _on_disk(lambda: source.replace(target), str(source))
            return
        try:
            self.write(to, self.read(name))
        except FileNotFoundError:
            return
        self.delete(name)

    def exists(self, name: str) -> bool:
        """Return whether the file exists."""
        return name in self.sizes([name])

    def is_folder(self, name: str) -> bool:
        """Return whether a folder is in a file's place; an object store has no folders."""
        return self.local_root is not None and Path(self.path(name)).is_dir()

    # --- many files ------------------------------------------------------------------------------------------
    def list(self, folder: str, endings: tuple[str, ...] = ("",)) -> dict[str, Entry]:
        """Return the files of one folder ("" is the root itself) by their names below the root, in one listing.

        ``endings`` limits them to names with one of these endings.
        """
        path, prefix = (self.path(folder), f"{folder}/") if folder else (self.root, "")
        if self.local_root is not None:
            return _on_disk(lambda: _list_folder(Path(path), prefix, endings), path)
        try:
            rows = _remotely(lambda: self._filesystem.ls(path, detail=True, refresh=True), path)
        except FileNotFoundError:
            return {}
        return {
            f"{prefix}{row['name'].rsplit('/', 1)[-1]}": Entry(int(row["size"]), _remote_version(row), _remote_md5(row))
            for row in rows
            if row["type"] == "file"
            and not row["name"].rsplit("/", 1)[-1].startswith(".")
            and row["name"].endswith(endings)
        }

    def sizes(self, names: Collection[str]) -> dict[str, int]:
        """Return sizes in bytes of the existing files among ``names``.

        This takes one stat each locally; elsewhere one listing per folder, or one request per file if they are few.
        """
        if self.local_root is not None:
            found = {}
            for name in names:
                try:
                    status = os.stat(self.path(name))  # noqa: PTH116 - a path object costs more than it
                    if not stat.S_ISDIR(status.st_mode):
                        found[name] = status.st_size
                except OSError as error:
                    if error.errno not in (errno.ENOENT, errno.ENOTDIR, *_OF_ONE_FILE):
                        raise
            return found
        by_folder: dict[str, list[str]] = {}
        for name in names:
            by_folder.setdefault(name.rpartition("/")[0], []).append(name)
        found = {}
        for folder, wanted in by_folder.items():
            if len(wanted) <= _ASKED_ONE_BY_ONE:
                asked = {name: self._remote_size(name) for name in wanted}
                found.update({name: size for name, size in asked.items() if size is not None})
            else:
                listed = self.list(folder)
                found.update({name: listed[name].size for name in wanted if name in listed})
        return found

    def _remote_size(self, name: str) -> int | None:
        path = self.path(name)
        try:
            row = _remotely(lambda: self._filesystem.info(path), path)
        except FileNotFoundError:
            return None
        return int(row["size"]) if row["type"] == "file" else None

    def read_many(
        self, names: Iterable[str], unreadable: Callable[[DamagedFile], None] | None = None
    ) -> dict[str, bytes]:
        """Return contents of the existing files among ``names``, fetched concurrently from an object store.

        ``unreadable`` is called with each error of a local file, which is left out; without it the error is raised.
        """

        def contents_of(name: str) -> bytes | None:
            try:
                return self.read(name)
            except FileNotFoundError:
                return None
            except DamagedFile as damaged:
                if unreadable is None:
                    raise
                unreadable(damaged)
                return None

        wanted = [check_name(name) for name in names]
        if self.local_root is not None:
            contents = list(map(contents_of, wanted))
        else:
            with ThreadPoolExecutor(_READ_CONCURRENTLY) as pool:
                contents = list(pool.map(contents_of, wanted))
        return {name: data for name, data in zip(wanted, contents, strict=True) if data is not None}

    def leftovers(self, folder: str = "") -> tuple[Path, ...]:
        """Return the temporary files in a folder (by default in all) whose writer is gone.

        An object store has none.
        """
        if self.local_root is None:
            return ()
        pattern = f"{_TEMPORARY}*"
        found = (self.local_root / check_name(folder)).glob(pattern) if folder else self.local_root.rglob(pattern)
        return tuple(file for file in found if is_abandoned(file, _TEMPORARY))

    def remove_leftovers(self, folder: str) -> int:
        """Delete the files that :meth:`leftovers` finds, and return their number."""
        found = self.leftovers(folder)
        for file in found:
            file.unlink(missing_ok=True)
        return len(found)


def _contents_of(path: str, name: str) -> bytes:
    try:
        # Hundreds of thousands of files are read for a warehouse: neither a path object nor a buffer for each.
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123
            return file.readall()
    except OSError as error:
        if error.errno in _OF_ONE_FILE:
            found = f"it cannot be read ({error.strerror})"
            raise DamagedFile(name, found, "check its permissions and the disk") from error
        raise


def _write_beside_and_rename(path: Path, data: bytes) -> None:
    prefix = temporary_prefix(_TEMPORARY)
    try:
        handle, temporary = tempfile.mkstemp(prefix=prefix, dir=path.parent)
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=prefix, dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _list_folder(path: Path, prefix: str, endings: tuple[str, ...]) -> dict[str, Entry]:
    found = {}
    try:
        with os.scandir(path) as entries:
            for entry in entries:
                name = entry.name
                if name.startswith(".") or not name.endswith(endings):
                    continue
                try:
                    status = entry.stat()
                except OSError as error:  # replaced or deleted since it was listed, or links that lead in a circle
                    if error.errno not in (errno.ENOENT, errno.ELOOP):
                        raise
                    continue
                if stat.S_ISREG(status.st_mode):
                    found[prefix + name] = Entry(status.st_size, f"{status.st_mtime_ns}-{status.st_ino}")
    except FileNotFoundError:
        return {}
    return found


def _remote_version(row: Mapping[str, Any]) -> str:
    for field in ("ETag", "etag", "generation", "LastModified", "mtime", "created"):
        if row.get(field):
            return str(row[field])
    return str(row["size"])


def _remote_md5(row: Mapping[str, Any]) -> str | None:
    """Return the MD5 that an S3-compatible store gives as the ETag of an object written in one piece.

    None for a store that encrypts with a key, whose ETag is no MD5.
    """
    etag = str(row.get("ETag", "")).strip('"')
    return etag if _MD5.fullmatch(etag) else None


def _on_disk(action: Callable[[], T], path: str) -> T:
    try:
        return action()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise FileNotFoundError(errno.ENOENT, "not in storage", path) from error
    except OSError as error:
        raise Failure(f"{path}: {error.strerror or error}; {remedy_of(error)}") from error


def _remotely(action: Callable[[], T], path: str) -> T:
    """Run an action, with several attempts and growing pauses, since object stores sometimes answer slowly or fail."""
    from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_exponential  # local storage needs none

    trying = Retrying(
        retry=retry_if_exception(_may_answer_later),
        stop=stop_after_attempt(_REMOTE_ATTEMPTS),
        wait=wait_exponential(multiplier=_REMOTE_FIRST_WAIT_S),
        reraise=True,
    )
    try:
        return trying(action)
    except PermissionError as error:
        raise Failure(f"{path}: access denied ({error}); check the credentials in the environment") from error
    except Exception as error:
        if type(error).__name__ in _NO_CREDENTIALS:
            raise Failure(f"{path}: {error}; set the credentials in the environment") from error
        if not _may_answer_later(error):
            raise
        reason = f"{type(error).__name__}: {error}"
        raise TransientFailure(f"{path}: no answer after {_REMOTE_ATTEMPTS} attempts ({reason}); run again") from error


def _may_answer_later(error: BaseException) -> bool:
    """Return whether an object store may answer a repeated request.

    The clients raise many kinds of errors for that (OSError, TimeoutError, classes of their own).
    """
    for_good = isinstance(error, FileNotFoundError | PermissionError | ImportError | ValueError)
    return isinstance(error, Exception) and not for_good and type(error).__name__ not in _NO_CREDENTIALS
