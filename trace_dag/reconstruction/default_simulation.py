"""The simulation with which estimators look ahead: the embedded back-end with its default settings.

The settings of a run are not used, because an estimate must follow from the record and the map alone.
"""

from __future__ import annotations

from typing import Final

from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.embedded import EmbeddedBackend, EmbeddedSimulation
from trace_dag.simulation.run import surface_friction

DEFAULTS: Final = SimSettings()


def default_simulation(network: RoadNetwork, record: CrashRecord) -> EmbeddedSimulation:
    """Return the map made ready, with the grip that the record's surface has."""
    return EmbeddedBackend(DEFAULTS).load(network, b"", friction=surface_friction(DEFAULTS, record))
