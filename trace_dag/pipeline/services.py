"""Public services as the stages and the registration of crashes use them: settings turned into clients.

One client per service, process and settings. All processes of a machine keep one rate, and answers are kept below the
storage root (beside it where the root is an object store), so that no crash is asked for twice.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from trace_dag.crash.crashapi import BASE_URL, CrashApiClient
from trace_dag.http import HttpClient, HttpPolicy
from trace_dag.osm.services import OSM_API, OVERPASS_ENDPOINTS, MapSource, OsmApiSource, OverpassSource
from trace_dag.pipeline.home import local_folder
from trace_dag.pipeline.registry import MapServiceName
from trace_dag.settings import ServiceSettings
from trace_dag.storage import Storage

CACHE_FOLDER = "cache"


@lru_cache(maxsize=8)
def crash_api(settings: ServiceSettings, storage: Storage, *, refresh: bool = False) -> CrashApiClient:
    """The CrashAPI. With ``refresh``, what it answered before is asked for again."""
    http = _http("crashapi", settings, storage, refresh=refresh)
    return CrashApiClient(http, (settings.crashapi_url or BASE_URL).rstrip("/"))


@lru_cache(maxsize=8)
def map_service(name: MapServiceName, settings: ServiceSettings, storage: Storage) -> MapSource:
    """A service that maps come from."""
    http = _http(name, settings, storage)
    if name == "overpass":
        return OverpassSource(http, settings.overpass_urls or OVERPASS_ENDPOINTS)
    return OsmApiSource(http, (settings.osm_api_url or OSM_API).rstrip("/"))


def _http(service: str, settings: ServiceSettings, storage: Storage, *, refresh: bool = False) -> HttpClient:
    base = Path(settings.cache_dir).expanduser() if settings.cache_dir else local_folder(storage) / CACHE_FOLDER
    folder = base / service
    policy = HttpPolicy(
        timeout_s=settings.timeout_s,
        attempts=settings.attempts,
        first_wait_s=settings.first_wait_s,
        requests_per_s=settings.requests_per_s,
        cache_only=settings.cache_only,
        refresh=refresh,
    )
    return HttpClient(policy, folder, turns=folder / "turns")
