"""Requirements of the settings on this machine and on services, checked before anything is replaced.

Each raises :class:`trace_dag.common.errors.UserError`.
"""

from __future__ import annotations

from trace_dag.common.settings import Settings
from trace_dag.flow.cohorts.services import Services
from trace_dag.roads.build import road_converter
from trace_dag.simulation.run import backend_factory


def road_map(settings: Settings, services: Services) -> None:
    """Check that the converter named in the settings is installed."""
    road_converter(settings.roads).require()


def state_estimate(settings: Settings, services: Services) -> None:
    """Check that the estimator in the settings is installed and that its services answer."""
    services.estimator(settings.states).require()


def simulation_log(settings: Settings, services: Services) -> None:
    """Check that the simulator in the settings is usable."""
    backend_factory(settings.sim).require(settings.sim)
