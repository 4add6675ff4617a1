"""The back-ends by their names in the settings."""

from __future__ import annotations

from functools import lru_cache

from trace_dag.settings import SimSettings
from trace_dag.sim.types import Backend


@lru_cache(maxsize=1)
def backend(settings: SimSettings) -> Backend:
    """The back-end the settings name, connected once per process; only that one is loaded."""
    if settings.backend == "embedded":
        from trace_dag.sim.embedded import EmbeddedBackend

        return EmbeddedBackend(settings)
    from trace_dag.sim.carla_backend import CarlaBackend

    return CarlaBackend(settings)
