"""Registering crashes from their sources: folders of reports, FARS CSV files, the CrashAPI; and their maps.

A local root refers to reports and maps where they lie; a root on an object store takes copies, so that workers need
nothing but the root.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.common.errors import UserError, UserErrors
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.messages.progress import OnProgress
from trace_dag.common.messages.wording import count_of
from trace_dag.common.storage.files import Storage
from trace_dag.crash.folder import FurtherFile, Unrecognised, scan
from trace_dag.crash.listing import CrashListing
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.kept_files import remove_unused_map_copies
from trace_dag.flow.cohorts.listings import remember
from trace_dag.flow.cohorts.registry import RegisteredMap, Registration, Registry, ReportSource, map_file
from trace_dag.flow.cohorts.sources import CrashApiSource, FolderSource, Source, TableSource

if TYPE_CHECKING:
    from trace_dag.crash.fars.crashapi import CrashApiClient

_UNSAFE = re.compile(r"[^A-Za-z0-9._-]")


@dataclass(frozen=True)
class IngestReport:
    """The registered crashes and those left aside.

    ``offered`` counts the crashes of the sources that the filter admits, ``maps`` the given map files. ``notes`` list
    what tables lack.
    """

    registration: Registration
    duplicates: tuple[FurtherFile, ...] = ()
    conflicts: tuple[FurtherFile, ...] = ()
    unrecognised: tuple[Unrecognised, ...] = ()
    offered: int = 0
    maps: int = 0
    notes: tuple[str, ...] = ()


@gc_paused()
def ingest(
    storage: Storage,
    cohort: str,
    *,
    reports: Sequence[Path] = (),
    maps: Sequence[Path] = (),
    tables: Sequence[TableSource] = (),
    crash_api: CrashApiClient | None = None,
    case_lists: CrashApiClient | None = None,
    choice: Choice = Choice(),  # noqa: B008 - immutable
    map_service: str | None = None,
    watch: bool = False,
    progress: OnProgress | None = None,
) -> IngestReport:
    """Register the chosen crashes of the sources. A crash in several sources comes from the first of them.

    With ``watch``, the folders of reports may still be empty and are read regularly from then on, and the cohort
    follows new releases of the CrashAPI. ``case_lists`` is the client for lists of cases, if it differs from
    ``crash_api``.

    Raises :class:`UserError` for folders without reports, files that are not OSM data, an empty choice and similar
    faults, and the errors of the CrashAPI's client; nothing is registered then.
    """
    found_maps = _maps(storage, maps)
    scanned = scan(reports)
    if reports and not scanned.reports and not watch:
        raise UserError(
            f"{', '.join(map(str, reports))}: no crash report among {count_of(len(scanned.unrecognised), 'file')}; "
            "expected CrashAPI GetCaseDetails responses in XML"
        )
    sources: list[Source] = [FolderSource(scanned.reports)] if scanned.reports else []
    sources += tables
    if crash_api is not None:
        sources.append(CrashApiSource(crash_api, progress, case_lists))
    offers, chosen = _chosen(storage, sources, choice)
    origin = f"{' and '.join(source.name for source in sources)}: {choice.in_words()}"
    registration = Registry(storage).register(
        cohort,
        chosen,
        found_maps,
        map_service=map_service,
        origin=origin,
        watched=[str(path.absolute()) for path in reports if path.is_dir()] if watch else (),
        followed=[choice] if watch and crash_api is not None else (),
    )
    if found_maps:
        remove_unused_map_copies(storage)
    return IngestReport(
        registration,
        scanned.duplicates,
        scanned.conflicts,
        scanned.unrecognised,
        offers,
        len(found_maps),
        tuple(note for source in tables for note in source.notes),
    )


def _chosen(storage: Storage, sources: Sequence[Source], choice: Choice) -> tuple[int, dict[str, ReportSource]]:
    """Return the number of crashes offered, and the reports of the chosen ones."""
    if not sources:
        return 0, {}
    offers: dict[str, CrashListing] = {}
    offered_by: dict[str, Source] = {}
    for source in sources:
        for listing in source.offers(choice):
            if offers.setdefault(listing.key, listing) is listing:
                offered_by[listing.key] = source
    names = " and ".join(source.name for source in sources)
    if not offers:
        notes = [note for source in sources if isinstance(source, TableSource) for note in source.notes]
        none = f"{names}: no crash that is asked for ({choice.in_words()}); ask for others or for more"
        raise UserErrors([*notes, none])
    missing = choice.cases - offers.keys()
    if missing:
        raise UserError(
            f"{names}: no crash {min(missing)} among those that the filters let through; "
            "look at the key, or leave a filter out"
        )
    by_source: dict[int, set[str]] = {}
    for listing in choice.sampled(offers.values()):
        by_source.setdefault(id(offered_by[listing.key]), set()).add(listing.key)
    chosen: dict[str, ReportSource] = {}
    known = ChainMap(*(dict(cohort.reports) for cohort in Registry(storage).cohorts().values()))
    for source in sources:
        chosen.update(source.take(storage, by_source.get(id(source), set()), known))
    remember(storage, chosen, offers)
    return len(offers), chosen


def _maps(storage: Storage, paths: Sequence[Path]) -> list[RegisteredMap]:
    if not paths:
        return []
    from trace_dag.osm.catalog import check_maps, map_files

    known = {file.sha256 for cohort in Registry(storage).cohorts().values() for file in cohort.maps}
    files = {path: map_file(path) for path in map_files(paths)}
    check_maps(path for path, file in files.items() if file.sha256 not in known)
    if storage.local_root is not None:
        return [*files.values()]
    return [_uploaded(storage, file) for file in files.values()]


def _uploaded(storage: Storage, file: RegisteredMap) -> RegisteredMap:
    path = Path(file.location)
    # The digest keeps maps of the same name apart. The name stays, because an extract says which map it is from.
    name = f"maps/{file.sha256[:16]}/{_UNSAFE.sub('_', path.name).lstrip('._-') or 'map'}"
    if storage.sizes([name]).get(name) != file.size:
        storage.write(name, path.read_bytes())
    return replace(file, location=name, stored=True)
