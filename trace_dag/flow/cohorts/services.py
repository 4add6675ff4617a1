"""The world outside as the stages and the registration of crashes use it: settings turned into clients.

One client per service, process and settings. All processes of a machine keep one rate, and answers are kept below the
storage root (beside it where the root is an object store), so that no crash is asked for twice. Clients are loaded when
they are first asked for.
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
    """The outside world for a stage in a run ("" where crashes are only looked at).

    None of it changes what comes out: how it is stored and fetched is in no fingerprint.
    """

    storage: Storage
    settings: ServiceSettings
    run_id: str = ""

    def crash_api(self) -> CrashApiClient:
        """Return the CrashAPI."""
        return crash_api(self.settings, self.storage)

    def map_source(self, name: str) -> MapSource:
        """Return a service that maps come from."""
        return _map_source(name, self.settings, self.storage)

    def map_file(self, file: RegisteredMap) -> Path:
        """Return a map file where it can be read from disk; one kept in storage is fetched once per machine."""
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
        """Return the estimator the settings name.

        Its answers, budget and rate are kept where all workers find them."""
        return _estimator(settings, self.storage, self.run_id or "run")


@lru_cache(maxsize=8)
def crash_api(settings: ServiceSettings, storage: Storage, *, refresh: bool = False) -> CrashApiClient:
    """Return the CrashAPI.

    With ``refresh``, what it answered before is asked for again.
    """
    from trace_dag.crash.fars.crashapi import BASE_URL, CrashApiClient

    http = _http("crashapi", settings, storage, refresh=refresh)
    return CrashApiClient(http, (settings.crashapi_url or BASE_URL).rstrip("/"))


def downloader(settings: ServiceSettings, storage: Storage) -> HttpClient:
    """Return fetches whole files, as large and as long as those of a state are."""
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
