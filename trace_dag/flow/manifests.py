"""Manifests of folders without outcome records: each file's size and SHA-256 as written.

``ROOT/<folder>/manifest.json`` lists the files of a folder: of the benchmark, of comparisons, evaluations,
traffic and variations. It is written after the files it lists. Outcome records list the artefacts and pictures of the
stages.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import DamagedFile
from trace_dag.common.processes import lock_file
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage, StoredFile

FOLDERS = ("comparisons", "evaluations", "traffic", "variations")
"""Folders all of whose files are listed in their manifest, beside the benchmark's."""

_OLDER = "ledgers"
_LOOKS = 3
_PAUSE_S = 0.1
_READ_AT_ONCE = 200

T = TypeVar("T")


@dataclass(frozen=True)
class Manifest:
    """The files of a folder by name. ``made_of`` has digests of the files' inputs, by crash or other subject."""

    files: dict[str, StoredFile] = field(default_factory=dict)
    made_of: dict[str, str] = field(default_factory=dict)

    def beginning(self, *starts: str) -> dict[str, StoredFile]:
        """Return the files whose name below the folder begins with one of ``starts``."""
        return {name: file for name, file in self.files.items() if name.rpartition("/")[2].startswith(starts)}


def manifest_name(folder: str) -> str:
    """Return the path of a folder's manifest below the root."""
    return f"{folder}/manifest.json"


def read_manifest(storage: Storage, folder: str) -> Manifest:
    """Return the manifest of a folder, empty if there is none.

    Raises :class:`DamagedFile`.
    """
    from pydantic import ValidationError

    name = manifest_name(folder)
    try:
        return json_adapter(Manifest).validate_python(check_document(storage.read(name), name=name))
    except FileNotFoundError:
        return Manifest()
    except ValidationError as error:
        raise DamagedFile(name, f"not a manifest ({error.errors()[0]['msg']})") from error


def sound_manifest(storage: Storage, folder: str) -> Manifest:
    """Return the manifest of a folder whose files can be made again; empty if missing or damaged."""
    try:
        return read_manifest(storage, folder)
    except DamagedFile:
        return Manifest()


def write_manifest(storage: Storage, folder: str, manifest: Manifest) -> None:
    """Store the manifest of a folder, replacing the present one."""
    in_order = Manifest(dict(sorted(manifest.files.items())), dict(sorted(manifest.made_of.items())))
    storage.write(manifest_name(folder), add_checksum(json_adapter(Manifest).dump_json(in_order)))


def is_of_older_version(storage: Storage) -> bool:
    """Return whether the files were made by a version without manifests, and no run of this version has followed."""
    return bool(storage.list(_OLDER))


def adopt_files(storage: Storage, folder: str) -> list[str]:
    """Make the manifest of a folder from its files; return the unreadable ones, which are left out."""
    from trace_dag.common.schemas import table_from_parquet

    files, unreadable = {}, []
    listed = sorted(set(storage.list(folder)) - {manifest_name(folder)})
    read = storage.read_many(listed, unreadable=lambda _: None)
    for name in listed:
        try:
            data = read[name]
            table_from_parquet(data) if name.endswith(".parquet") else json.loads(data)
            files[name] = StoredFile(name, len(data), hashlib.sha256(data).hexdigest())
        except (KeyError, ValueError, OSError):  # ArrowInvalid is a ValueError
            unreadable.append(name)
    if files:
        write_manifest(storage, folder, Manifest(files))
    return unreadable


def bring_up_to_date(storage: Storage) -> None:
    """Add manifests to the files of a version without them, copy its cohorts, and delete its lists."""
    if not is_of_older_version(storage):
        return
    from trace_dag.flow.cohorts.registry import Registry

    registry = Registry(storage)
    for damaged in registry.damage():
        registry.put_back(damaged.name)
    for folder in FOLDERS:
        if not storage.exists(manifest_name(folder)):
            adopt_files(storage, folder)
    for folder in (_OLDER, *(f"{_OLDER}/{each}" for each in FOLDERS)):
        for name in storage.list(folder):
            storage.delete(name)


def list_files(storage: Storage, folder: str, files: Iterable[StoredFile], gone: Iterable[str] = ()) -> None:
    """Add files to the manifest of a folder, and remove others by name."""
    with _alone(storage, folder):
        before, left = sound_manifest(storage, folder), set(gone)
        kept = {name: file for name, file in before.files.items() if name not in left}
        write_manifest(storage, folder, Manifest(kept | {file.name: file for file in files}, before.made_of))


def read_listed(storage: Storage, name: str, *, remedy: str) -> bytes:
    """Return the content of a file that agrees with its manifest.

    Raises :class:`DamagedFile` with the remedy if it does not.
    """
    folder = name.partition("/")[0]

    def look() -> bytes:
        file = read_manifest(storage, folder).files.get(name)
        if file is None:
            raise DamagedFile(name, f"{manifest_name(folder)} does not list it")
        return storage.read_whole(file)

    return check_listed(look, remedy=remedy)


def check_listed(look: Callable[[], T], *, remedy: str) -> T:
    """Return the result of ``look``, which raises :class:`DamagedFile` if a file is not as listed.

    It is tried several times, since files that are being replaced agree with their list a moment later.
    """
    from tenacity import Retrying, retry_if_exception_type, stop_after_attempt, wait_fixed  # 0.05 s of start-up

    looking = Retrying(
        retry=retry_if_exception_type(DamagedFile),
        stop=stop_after_attempt(_LOOKS),
        wait=wait_fixed(_PAUSE_S),
        reraise=True,
    )
    try:
        return looking(look)
    except DamagedFile as damaged:
        raise damaged.mended_by(remedy) from damaged


def not_as_listed(
    storage: Storage,
    files: Iterable[StoredFile],
    *,
    contents: bool = False,
    told: Callable[[int], None] = lambda _: None,
) -> Iterator[tuple[StoredFile, str]]:
    """Yield files that are missing or have another size, each with its fault; ``contents`` compares the bytes as well.

    ``told`` receives the number of files read.
    """
    files = list(files)
    sizes = storage.sizes([file.name for file in files])
    whole = []
    for file in files:
        size = sizes.get(file.name)
        if size is None:
            yield file, f"{file.name} is not there"
        elif size != file.size:
            yield file, f"{file.name} has {size} bytes, recorded are {file.size}"
        else:
            whole.append(file)
    for start in range(0, len(whole) if contents else 0, _READ_AT_ONCE):
        some = whole[start : start + _READ_AT_ONCE]
        unreadable: list[DamagedFile] = []
        read = storage.read_many((file.name for file in some), unreadable.append)
        why = {damaged.name: damaged.found for damaged in unreadable}
        for file in some:
            if file.name in why:
                yield file, f"{file.name}: {why[file.name]}"
            elif not file.matches(read.get(file.name, b"")):
                yield file, f"{file.name} has its recorded size and another content"
        told(len(some))


@contextmanager
def _alone(storage: Storage, folder: str) -> Iterator[None]:
    """Keep other processes of this machine from changing a manifest meanwhile."""
    if storage.local_root is None:
        yield
        return
    (storage.local_root / "locks").mkdir(exist_ok=True)
    with lock_file(storage.local_root / "locks" / folder):
        yield
