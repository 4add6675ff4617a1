"""What the settings ask of this machine, looked at before a run. Each raises :class:`trace_dag.errors.UserError`."""

from __future__ import annotations

from trace_dag.settings import Settings


def road_map(settings: Settings) -> None:
    """The converter the settings name has to be installed."""
    if settings.roads.converter == "osm2odr":
        from trace_dag.roads.from_osm.osm2odr import require_osm2odr

        require_osm2odr()


def simulation_log(settings: Settings) -> None:
    """The simulator the settings name has to be there."""
    if settings.sim.backend == "carla":
        from trace_dag.sim.carla_backend import require_carla

        require_carla(settings.sim)
