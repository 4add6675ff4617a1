"""What is stored beside the stages' artefacts, each file with the size and SHA-256 it was written with.

``ROOT/ledgers/<subject>.json`` lists the files of one subject that were made together: the benchmark, a comparison of
one cohort, the evaluations of one agent, the variations of one crash, the warehouse. A ledger is written after the
files it lists, under a seal (:mod:`trace_dag.sealing`). Outcome records list the artefacts and pictures of the stages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from trace_dag.errors import DamagedFile, Failure
from trace_dag.sealing import is_sealed, sealed, unsealed
from trace_dag.storage import Storage, StoredFile

if TYPE_CHECKING:
    from pydantic import TypeAdapter

FOLDER = "ledgers"
SUBJECT_FOLDERS = ("comparisons", "evaluations", "variations")
"""Folders all of whose files are listed in ledgers of their own; ``ledgers/`` has a folder for each."""

_LOOKS = 3
_PAUSE_S = 0.1
_READ_AT_ONCE = 200

T = TypeVar("T")
Complaint = Callable[[Failure], None]
"""Hears of one crash or file that had to be left out, while the others go on."""


def raised(failure: Failure) -> None:
    """The complaint handler for callers that need everything: it raises the error."""
    raise failure


@dataclass(frozen=True)
class Ledger:
    """The files of one subject by name. ``made_of`` holds, by crash, a digest of what its files were made from."""

    files: dict[str, StoredFile] = field(default_factory=dict)
    made_of: dict[str, str] = field(default_factory=dict)


def ledger_name(subject: str) -> str:
    """Where the ledger of a subject lies below the root."""
    return f"{FOLDER}/{subject}.json"


def write_ledger(
    storage: Storage, subject: str, files: Iterable[StoredFile], made_of: Mapping[str, str] | None = None
) -> None:
    """Store the list of a subject's files; it replaces the subject's earlier ledger."""
    ledger = Ledger({file.name: file for file in files}, dict(made_of or {}))
    storage.write(ledger_name(subject), sealed(_ledgers().dump_json(ledger)))


def read_ledger(storage: Storage, subject: str) -> Ledger:
    """The ledger of a subject, an empty one if there is none. Raises :class:`DamagedFile`."""
    name = ledger_name(subject)
    try:
        return _read(storage.read(name), name)
    except FileNotFoundError:
        return Ledger()


def sound_ledger(storage: Storage, subject: str) -> Ledger:
    """The ledger of a subject whose files can be made again: an empty ledger if it is missing or damaged."""
    try:
        return read_ledger(storage, subject)
    except DamagedFile:
        return Ledger()


def read_listed(storage: Storage, subject: str, name: str, *, remedy: str) -> bytes:
    """The content of a file that agrees with its ledger; :class:`DamagedFile`, naming the remedy, if it does not."""

    def look() -> bytes:
        file = read_ledger(storage, subject).files.get(name)
        if file is None:
            raise DamagedFile(name, f"{ledger_name(subject)} does not list it")
        return storage.read_whole(file)

    return agreed(look, remedy=remedy)


def agreed(look: Callable[[], T], *, remedy: str) -> T:
    """What ``look`` finds, which raises :class:`DamagedFile` where a file and its ledger do not agree.

    Files that are being replaced agree with their ledger a moment later, so it looks several times.
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


def subjects(storage: Storage, folder: str = "") -> list[str]:
    """The subjects that have a ledger: those of one folder, or those in no folder."""
    listed = storage.list(f"{FOLDER}/{folder}" if folder else FOLDER)
    return [name.removeprefix(f"{FOLDER}/").removesuffix(".json") for name in listed]


def not_as_listed(
    storage: Storage,
    files: Iterable[StoredFile],
    *,
    contents: bool = False,
    told: Callable[[int], None] = lambda _: None,
) -> Iterator[tuple[StoredFile, str]]:
    """Files that are missing or of another size, with ``contents`` also those of another content; and what is found.

    ``told`` hears how many have been read.
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


def _read(data: bytes, name: str) -> Ledger:
    from pydantic import ValidationError

    try:
        if not is_sealed(data):
            raise DamagedFile(name, "it has no seal")
        return _ledgers().validate_json(unsealed(data, name=name))
    except ValidationError as error:
        raise DamagedFile(name, f"not a ledger ({error.errors()[0]['msg']})") from error


@cache
def _ledgers() -> TypeAdapter[Ledger]:
    from pydantic import TypeAdapter

    return TypeAdapter(Ledger)
