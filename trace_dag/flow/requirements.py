"""What the settings ask of this machine, looked at before a run. Each raises :class:`trace_dag.errors.UserError`."""

from __future__ import annotations

from trace_dag.roads.build import road_converter
from trace_dag.settings import Settings
from trace_dag.sim.backends import backend_factory


def road_map(settings: Settings) -> None:
    """The converter the settings name has to be installed."""
    road_converter(settings.roads).require()


def simulation_log(settings: Settings) -> None:
    """The simulator the settings name has to be there."""
    backend_factory(settings.sim).require(settings.sim)
