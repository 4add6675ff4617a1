"""Find and connect the simulator back-end that the settings name, among those that installed packages register."""

from __future__ import annotations

from functools import lru_cache

from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.settings import SimSettings
from trace_dag.simulation.types import Backend, BackendFactory


def backend_factory(settings: SimSettings) -> BackendFactory:
    """Return the factory of the back-end.

    Raises :class:`trace_dag.common.errors.UserError` if it cannot be loaded.

    >>> type(backend_factory(SimSettings(backend="embedded"))(SimSettings())).__name__
    'EmbeddedBackend'
    """
    factory: BackendFactory = load(PluginKind.BACKEND, settings.backend)
    return factory


@lru_cache(maxsize=1)
def backend(settings: SimSettings) -> Backend:
    """Return the back-end, connected once per process.

    Other back-ends are not imported.

    >>> type(backend(SimSettings(backend="embedded"))).__name__
    'EmbeddedBackend'
    """
    return backend_factory(settings)(settings)
