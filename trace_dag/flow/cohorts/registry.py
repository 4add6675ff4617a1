"""Cohorts: crashes, each with its report and its maps.

One file per cohort, ``ROOT/cohorts/<name>.parquet``: a row per crash, and all else in its metadata. A crash belongs to
the cohort that registered it first, so that every crash is counted once. Repeated registration is harmless: known
crashes stay, new ones are added, and changed reports are marked as changed. Does not belong here: reading reports or
maps.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.provenance import combine_digests, now
from trace_dag.common.storage.checksums import add_checksum, check_document, check_table, write_table
from trace_dag.common.storage.files import Storage
from trace_dag.crash.keys import parse_key
from trace_dag.flow.cohorts.choice import Choice

if TYPE_CHECKING:
    import pyarrow as pa

_FOLDER = "cohorts"
_COPIES = "cohorts/copies"  # of each file, in case one is lost: nothing else says where reports and maps are
_NAMES = "cohorts/names"  # of the cohorts there are: so one is missed whose file and copy are both lost
_REMEDY = "trace-dag verify --repair puts it back from its copy, or else registers its crashes from their records"
_SUFFIX = ".parquet"
_COLUMNS: Final = ("kind", "location", "sha256")
_AT_ONCE: Final = 20_000  # crashes that are turned into rows
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")


@dataclass(frozen=True, slots=True)
class ReportSource:
    """The origin of a crash's report.

    ``file``: ``location`` is a path. ``stored``: a name below the storage root. ``crashapi``: the service, asked for
    this crash (``location`` is empty). ``sha256`` of the content, if known beforehand.
    """

    kind: Literal["file", "stored", "crashapi"]
    location: str = ""
    sha256: str = ""


@dataclass(frozen=True)
class RegisteredMap:
    """A file of OSM data: a path, or a name below the storage root if ``stored``."""

    location: str
    sha256: str
    size: int
    stored: bool = False


@dataclass(frozen=True)
class CrashSource:
    """Sources of a crash: its report, its maps and their cohort."""

    cohort: str
    report: ReportSource
    maps: tuple[RegisteredMap, ...] = ()
    map_service: str | None = None
    lost_maps: str | None = None

    @property
    def maps_digest(self) -> str:
        """Return one SHA-256 for all map files and the service beside them."""
        if self.lost_maps is not None and not self.maps:
            return self.lost_maps
        return _maps_digest(self.maps, self.map_service)


@lru_cache(maxsize=64)
def _maps_digest(maps: tuple[RegisteredMap, ...], map_service: str | None) -> str:
    """Return the digest of the maps, which thousands of crashes share."""
    files = {file.sha256: Path(file.location).name for file in maps}
    return combine_digests(files | ({"service": map_service} if map_service else {}))


@dataclass(frozen=True)
class Cohort:
    """A named set of crashes that share their maps. Reports by key.

    ``map_service`` is used if no map file covers a crash. ``origins`` describes the source and choice of the crashes,
    once for each time the cohort grew. Reports that arrive in the ``watched`` folders join it, and so do crashes of the
    ``followed`` choices that the CrashAPI releases later. ``lost_maps`` is the digest of its maps after the registry
    was lost; it counts until maps are registered again.
    """

    name: str
    created_at: str
    reports: Mapping[str, ReportSource] = field(default_factory=dict)
    maps: tuple[RegisteredMap, ...] = ()
    map_service: str | None = None
    origins: tuple[str, ...] = ()
    watched: tuple[str, ...] = ()
    followed: tuple[Choice, ...] = ()
    lost_maps: str | None = None

    @property
    def keys(self) -> list[str]:
        """Return the crashes, in order."""
        return list(self.reports)


class _Reports(Mapping[str, ReportSource]):
    """Reports by key, in order, as columns of a table, since a year of a country has half a million."""

    def __init__(self, table: pa.Table) -> None:
        self._keys: list[str] = table["key"].to_pylist()
        self._columns = [table[name].combine_chunks() for name in _COLUMNS]

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {key: row for row, key in enumerate(self._keys)}

    def __getitem__(self, key: str) -> ReportSource:
        row = self._rows[key]
        return ReportSource(*(column[row].as_py() for column in self._columns))

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def __contains__(self, key: object) -> bool:
        return key in self._rows


def _table_of(reports: Mapping[str, ReportSource], keys: Iterable[str]) -> pa.Table:
    """Return the table of some reports, made in parts."""
    import pyarrow as pa

    schema = pa.schema([(name, pa.string()) for name in ("key", *_COLUMNS)])
    parts, left = [], iter(keys)
    while part := list(islice(left, _AT_ONCE)):
        rows = [reports[key] for key in part]
        columns = [part, *(list(map(attrgetter(name), rows)) for name in _COLUMNS)]
        parts.append(pa.table(columns, schema=schema))
    return pa.concat_tables(parts) if parts else schema.empty_table()


@dataclass(frozen=True)
class Registration:
    """The result of registering: keys by whether they are new, known or changed."""

    added: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    elsewhere: Mapping[str, str] = field(default_factory=dict)  # key -> the cohort it belongs to
    maps_added: int = 0


_COHORTS = TypeAdapter(Cohort)


def in_order(keys: Iterable[str]) -> list[str]:
    """Return unique keys in order of registration: FARS by year and case number, then each other register.

    >>> in_order(["2023-510010", "tempe-7", "2023-40002", "2015-390503", "2023-510010"])
    ['2015-390503', '2023-40002', '2023-510010', 'tempe-7']
    """
    return sorted(set(keys), key=lambda key: parse_key(key).order)


class Registry:
    """The cohorts of one storage root. An unchanged file is not parsed again: a year has 5 MB of them."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self._known: dict[str, tuple[bytes, Cohort]] = {}

    def cohorts(self) -> dict[str, Cohort]:
        """Return all cohorts by name.

        Raises :class:`DamagedFile` for a cohort that is lost or damaged.
        """
        names = {name for name in self._storage.list(_FOLDER) if name.endswith(_SUFFIX)}
        for name in sorted((self._copied() | self._noted()) - names):
            raise DamagedFile(name, "it is not there", _REMEDY)
        found = {}
        for name, data in sorted(self._storage.read_many(names).items()):
            if name not in self._known or self._known[name][0] != data:
                self._known[name] = (data, _cohort(name, data))
            cohort = self._known[name][1]
            found[cohort.name] = cohort
        return found

    def damage(self) -> list[DamagedFile]:
        """Return the damaged or lost files of cohorts, and of their copies."""
        there = {name for name in self._storage.list(_FOLDER) if name.endswith(_SUFFIX)}
        there |= self._copied() | self._noted()
        found = []
        for name in sorted(there):
            for each in (name, _copy_of(name)):
                try:
                    _cohort(each, self._storage.read(each))
                except FileNotFoundError:
                    found.append(DamagedFile(each, "it is not there", _REMEDY))
                except DamagedFile as damaged:
                    found.append(damaged)
        return found

    def put_back(self, name: str) -> bool:
        """Replace a file of a cohort by its copy, or the copy by the file; return whether the source was whole."""
        other = name.replace(_COPIES, _FOLDER) if name.startswith(_COPIES) else _copy_of(name)
        try:
            data = self._storage.read(other)
            _cohort(other, data)
        except (FileNotFoundError, DamagedFile):
            return False
        self._storage.write(name, data)
        return True

    def _copied(self) -> set[str]:
        return {name.replace(_COPIES, _FOLDER) for name in self._storage.list(_COPIES) if name.endswith(_SUFFIX)}

    def _noted(self) -> set[str]:
        """Return the files in the list of cohorts; empty if the list is damaged or missing."""
        try:
            noted = check_document(self._storage.read(_NAMES), name=_NAMES)["names"]
            return {name for name in noted if name.endswith(_SUFFIX)}  # others are of versions before
        except (FileNotFoundError, DamagedFile):
            return set()

    def _note(self, names: Collection[str]) -> None:
        self._storage.write(_NAMES, add_checksum(json.dumps({"names": sorted(names)}).encode()))

    def _write(self, cohort: Cohort) -> None:
        about = _COHORTS.dump_json(cohort, exclude={"reports"})
        data = write_table(_table_of(cohort.reports, cohort.reports), about)
        first = f"{_FOLDER}/{cohort.name}{_SUFFIX}"
        for name in (first, _copy_of(first)):
            self._storage.write(name, data)
        if first not in (noted := self._noted()):
            self._note(noted | self._copied())

    def forget(self, cohort: str) -> None:
        """Delete the files of a cohort."""
        self._note(self._noted() - {f"{_FOLDER}/{cohort}{_SUFFIX}"})
        for folder in (_COPIES, _FOLDER):  # a copy without its file would be a loss
            self._storage.delete(f"{folder}/{cohort}{_SUFFIX}")

    def listed(self) -> str:
        """Return a digest (SHA-256, hexadecimal) of the listed files of the cohorts.

        It changes with any of them.
        """
        return hashlib.sha256(repr(sorted(self._storage.list(_FOLDER).items())).encode()).hexdigest()

    def cohort(self, name: str) -> Cohort:
        """Return one cohort.

        Raises :class:`UserError` for an unknown name.
        """
        cohorts = self.cohorts()
        if name not in cohorts:
            raise UserError(f"cohort {name!r} is not registered; there is {', '.join(cohorts) or 'none yet'}")
        return cohorts[name]

    def keys(self, cohort: str | None = None) -> list[str]:
        """Return the crashes of one cohort or of all, in order.

        Raises :class:`UserError` for an unknown cohort.
        """
        if cohort is not None:
            return self.cohort(cohort).keys
        cohorts = list(self.cohorts().values())
        return cohorts[0].keys if len(cohorts) == 1 else in_order(key for each in cohorts for key in each.reports)

    def sources(self, keys: Iterable[str]) -> dict[str, CrashSource]:
        """Return the origins of some crashes.

        Raises :class:`UserError` for a key that is not registered.
        """
        cohorts = self.cohorts().values()
        found = {}
        for key in keys:
            parse_key(key)
            for cohort in cohorts:
                if key in cohort.reports:
                    found[key] = CrashSource(
                        cohort.name, cohort.reports[key], cohort.maps, cohort.map_service, cohort.lost_maps
                    )
                    break
            else:
                raise UserError(f"crash {key} is not registered in {self._storage.root}; see trace-dag ingest")
        return found

    def register(
        self,
        cohort: str,
        reports: Mapping[str, ReportSource],
        maps: Iterable[RegisteredMap] = (),
        *,
        map_service: str | None = None,
        origin: str = "",
        watched: Iterable[str] = (),
        followed: Iterable[Choice] = (),
        lost_maps: str | None = None,
    ) -> Registration:
        """Add reports and maps to a cohort, which is made if missing.

        ``map_service`` replaces the present one if given; ``origin`` is recorded if it brought crashes; ``lost_maps``
        is the digest of maps that are no longer known.
        """
        if not _NAME.fullmatch(cohort):
            raise UserError(f"cohort name {cohort!r}: expected letters, digits, '-' and '_' only, 64 at most")
        cohorts = self.cohorts()
        before = cohorts.pop(cohort, None) or Cohort(cohort, now())
        elsewhere = {key: other.name for other in cohorts.values() for key in reports if key in other.reports}
        added, changed, known = [], [], []
        for key in in_order(reports):
            if key in elsewhere:
                continue
            if key not in before.reports:
                added.append(key)
            elif before.reports[key] != reports[key]:
                changed.append(key)
            else:
                known.append(key)
        new = {key: reports[key] for key in (*added, *changed)}
        merged = {file.location: file for file in before.maps} | {file.location: file for file in maps}
        after = replace(
            before,
            reports=_merged(before.reports, new),
            maps=tuple(merged[location] for location in sorted(merged)),
            map_service=map_service or before.map_service,
            origins=(*before.origins, origin) if origin and added else before.origins,
            watched=tuple(sorted({*before.watched, *watched})),
            followed=tuple(dict.fromkeys((*before.followed, *followed))),
            lost_maps=lost_maps or before.lost_maps,
        )
        if new or after != before or not before.reports:
            self._write(after)
        return Registration(tuple(added), tuple(changed), tuple(known), elsewhere, len(after.maps) - len(before.maps))

    def drop_maps(self, files: Collection[str], cohort: str | None = None) -> dict[str, tuple[str, ...]]:
        """Remove map files, given by path or name, from one cohort or all; return the removed files by cohort.

        The next run cuts new extracts. Raises :class:`UserError` for a file that no cohort has.
        """
        cohorts = [self.cohort(cohort)] if cohort is not None else list(self.cohorts().values())
        gone = {each.name: {file: found for file in files if (found := _dropped(each, file))} for each in cohorts}
        for file in files:
            if not any(file in found for found in gone.values()):
                raise UserError(f"{file}: no such map file is registered; trace-dag cohort maps lists them")
        for each in cohorts:
            left = tuple(file for file in each.maps if file not in gone[each.name].values())
            if left != each.maps:
                self._write(replace(each, maps=left))
        return {name: tuple(file.location for file in found.values()) for name, found in gone.items() if found}

    def leaving(self, cohort: str, only: Collection[str] = ()) -> tuple[str, ...]:
        """Return the crashes that :meth:`remove` would remove, in order.

        Raises :class:`UserError` for an unknown cohort or crash.
        """
        before = self.cohort(cohort)
        for key in only:
            if key not in before.reports:
                raise UserError(
                    f"crash {key} is not in cohort {cohort}; trace-dag cohort show {cohort} --json lists those that are"
                )
        return tuple(in_order(only or before.keys))

    def remove(self, cohort: str, only: Collection[str] = ()) -> tuple[str, ...]:
        """Remove a cohort, or some of its crashes; return the crashes that are no longer registered, in order.

        Their results stay in storage. Raises the errors of :meth:`leaving`.
        """
        gone = self.leaving(cohort, only)
        if not only:
            self.forget(cohort)
            return gone
        before = self.cohort(cohort)
        self._write(replace(before, reports={key: each for key, each in before.reports.items() if key not in only}))
        return gone


def _merged(before: Mapping[str, ReportSource], new: Mapping[str, ReportSource]) -> Mapping[str, ReportSource]:
    if not new:
        return before
    keys = in_order((*before, *new)) if before else new  # which are in order
    return {key: new.get(key) or before[key] for key in keys}


def _copy_of(name: str) -> str:
    return name.replace(_FOLDER, _COPIES, 1)


def _cohort(name: str, data: bytes) -> Cohort:
    try:
        table, about = check_table(data, name=name)
        cohort = replace(_COHORTS.validate_json(about), reports=_Reports(table))
        if cohort.name != Path(name).stem:
            raise DamagedFile(name, f"the file of cohort {cohort.name}", _REMEDY)
        return cohort
    except ValidationError as error:
        raise DamagedFile(name, f"not a cohort file ({error.errors()[0]['msg']})", _REMEDY) from error
    except DamagedFile as damaged:
        raise damaged.mended_by(_REMEDY) from damaged


def _dropped(cohort: Cohort, file: str) -> RegisteredMap | None:
    """Return the map file of a cohort with this path or name, or None."""
    exact = [each for each in cohort.maps if each.location in (file, str(Path(file).absolute()))]
    named = exact or [each for each in cohort.maps if Path(each.location).name == Path(file).name]
    if len(named) > 1:
        raise UserError(f"{file}: {len(named)} map files of cohort {cohort.name} are called so; give the whole path")
    return named[0] if named else None


def map_file(path: Path) -> RegisteredMap:
    """Return a local map file with its digest."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return RegisteredMap(str(path.absolute()), digest, path.stat().st_size)
