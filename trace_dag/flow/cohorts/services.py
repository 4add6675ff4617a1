"""Clients of external services (CrashAPI, map servers, language models) for stages and registration, from settings.

There is one client per service, process and settings. All processes of a machine keep one request rate. Answers are
cached below the storage root (on this machine if the root is an object store), so that no crash is requested twice.
Clients are loaded on first use.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import Failure
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.settings import ServiceSettings, StateSettings
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.cohorts.registry import RegisteredMap

if TYPE_CHECKING:
    from trace_dag.common.network.http import HttpClient
    from trace_dag.crash.fars.crashapi import CrashApiClient
    from trace_dag.osm.services import MapSource, MapSourceFactory
    from trace_dag.reconstruction.estimate import Estimator

CACHE_FOLDER = "cache"
_MAP_BY_HAND = (
    "download a map of the state (https://download.geofabrik.de/north-america/us.html) where there is a network, and "
    "give it to trace-dag ingest --maps FILE --cohort NAME"
)
_WITHOUT_NETWORK = {
    "crashapi": "download the FARS tables of the years (https://www.nhtsa.gov/file-downloads?p=nhtsa/downloads/FARS) "
    "where there is a network, and give them to trace-dag ingest --fars-csv FILE --cohort NAME",
    "downloads": "download the file where there is a network, and put it into this folder",
    "overpass": _MAP_BY_HAND,
    "osm-api": _MAP_BY_HAND,
}
"""Remedies for each service that cannot be asked."""


def map_copies(storage: Storage) -> Path:
    """Return the folder of this machine with copies of map files that are kept on an object store."""
    return storage.local_folder / CACHE_FOLDER / "map-copies"


@dataclass(frozen=True)
class Services:
    """The external services for a run, or "" if crashes are only read.

    They do not affect results, so their settings are in no fingerprint.
    """

    storage: Storage
    settings: ServiceSettings
    run_id: str = ""

    def crash_api(self) -> CrashApiClient:
        """Return the CrashAPI."""
        return crash_api(self.settings, self.storage)

    def map_source(self, name: str) -> MapSource:
        """Return a map service by name."""
        return _map_source(name, self.settings, self.storage)

    def map_file(self, file: RegisteredMap) -> Path:
        """Return the local path of a map file; one kept in storage is fetched once per machine."""
        if not file.stored:
            path = Path(file.location)
            leave_out = f"leave it out: trace-dag cohort maps --drop {shlex.quote(str(path))}"
            if not path.is_file():
                raise Failure(f"{path}: the map file is no longer there; put it back, or {leave_out}")
            if (size := path.stat().st_size) != file.size:
                raise Failure(
                    f"{path}: not the map file that was ingested: it has {size:,} bytes, and had {file.size:,}; "
                    f"put that one back, ingest this one (trace-dag ingest --maps {shlex.quote(str(path))} --cohort "
                    f"and its name), or {leave_out}"
                )
            return path
        cache = map_copies(self.storage)
        copy = cache / file.location
        if not copy.is_file() or copy.stat().st_size != file.size:
            Storage(cache).write(
                file.location, self.storage.read_whole(StoredFile(file.location, file.size, file.sha256))
            )
        return copy

    def estimator(self, settings: StateSettings) -> Estimator:
        """Return the estimator that the settings name.

        Its answers, budget and rate are shared by all workers.
        """
        return _estimator(settings, self.storage, self.run_id or "run")


@lru_cache(maxsize=8)
def crash_api(settings: ServiceSettings, storage: Storage, *, refresh: bool = False) -> CrashApiClient:
    """Return the CrashAPI client.

    With ``refresh`` it does not use cached answers.
    """
    from trace_dag.crash.fars.crashapi import BASE_URL, CrashApiClient

    http = _http("crashapi", settings, storage, refresh=refresh)
    return CrashApiClient(http, (settings.crashapi_url or BASE_URL).rstrip("/"))


def downloader(settings: ServiceSettings, storage: Storage) -> HttpClient:
    """Return a client for whole files, with limits that suit a state's files."""
    return _http("downloads", settings, storage, max_bytes=8 * 1024**3, total_s=6 * 3600.0)


@lru_cache(maxsize=8)
def _map_source(name: str, settings: ServiceSettings, storage: Storage) -> MapSource:
    make: MapSourceFactory = load(PluginKind.MAP_SOURCE, name)
    return make(settings, _http(name, settings, storage))


@lru_cache(maxsize=8)
def _estimator(settings: StateSettings, storage: Storage, ledger: str) -> Estimator:
    from trace_dag.reconstruction.estimate import estimator_factory

    return estimator_factory(settings)(settings, storage, ledger)


def _http(
    service: str, settings: ServiceSettings, storage: Storage, *, refresh: bool = False, **limits: Any
) -> HttpClient:
    from trace_dag.common.network.http import HttpClient, HttpPolicy

    base = Path(settings.cache_dir).expanduser() if settings.cache_dir else storage.local_folder / CACHE_FOLDER
    folder = base / service
    policy = HttpPolicy(
        timeout_s=settings.timeout_s,
        attempts=settings.attempts,
        first_wait_s=settings.first_wait_s,
        requests_per_s=settings.requests_per_s,
        cache_only=settings.cache_only,
        refresh=refresh,
        **limits,
    )
    return HttpClient(policy, folder, turns=folder / "turns", instead=_WITHOUT_NETWORK.get(service, ""))
