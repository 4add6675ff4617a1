"""CARLA 0.9.15 and 0.9.16 as a back-end: the map as stored, the same plans, CARLA's physics, the same log.

The server runs in synchronous mode with the log's step; PhysX sub-steps below it. Until its first contact a vehicle is
carried along its plan by target velocities (the plan's, plus what brings it back to its planned position), its
wheels steered to match; after it nobody drives and brakes hold as many of its wheels as the settings lock. Contacts
come from collision sensors; their place is computed from the two bounding boxes as in the embedded back-end, since
the sensor gives none. Every exit destroys what was spawned and gives the server its settings back.

The ``carla`` package is the extra of that name; everything goes through the module object, so that a
stand-in can take its place.
"""

from __future__ import annotations

import socket
from typing import Any

from trace_dag.carla.simulation import BACKEND_NAME, CarlaSimulation, server_errors
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.settings import SimSettings
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.types import Simulation

SUPPORTED_VERSIONS = ("0.9.15", "0.9.16")
_TIMEOUT_S = 60.0
_PROBE_TIMEOUT_S = 5.0


def _carla_package() -> Any:
    try:
        import carla
    except ImportError as error:
        raise UserError(
            "the CARLA back-end needs the carla package: pip install 'trace-dag[carla]', "
            "or use sim.backend = 'embedded'"
        ) from error
    return carla


class CarlaBackend:
    """A connection to one CARLA server, made when the first map is loaded."""

    name = BACKEND_NAME
    one_at_a_time = True

    def __init__(self, settings: SimSettings, module: Any = None) -> None:
        self._settings = settings
        self._carla = module
        self._client: Any = None
        self.version = ""

    @staticmethod
    def require(settings: SimSettings) -> None:
        """Raise :class:`UserError` if the ``carla`` package is missing or no server listens at the address."""
        _carla_package()
        host, port = settings.carla_host, settings.carla_port
        try:
            socket.create_connection((host, port), timeout=_PROBE_TIMEOUT_S).close()
        except OSError as error:
            raise UserError(
                f"no CARLA server answers at {host}:{port} ({error}); start one, set sim.carla_host and "
                "sim.carla_port, or use sim.backend = 'embedded'"
            ) from error

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> Simulation:
        """Build the server's world from the stored map, without walls at the roads' edges.

        Raises :class:`UserError` if the ``carla`` package is missing, :class:`Failure` for a server of another version,
        :class:`TransientFailure` if no server answers.
        """
        client = self._connected()
        parameters = self._carla.OpendriveGenerationParameters(
            vertex_distance=2.0,
            max_road_length=50.0,
            wall_height=0.0,
            additional_width=2.0,
            smooth_junctions=True,
            enable_mesh_visibility=True,
        )
        with server_errors("building the map"):
            world = client.generate_opendrive_world(xodr.decode("utf-8"), parameters)
        return CarlaSimulation(self._carla, world, self._settings, friction, self.version)

    def close(self) -> None:
        """Drop the connection; each run has restored the server's settings."""
        self._client = None

    def _connected(self) -> Any:
        if self._client is not None:
            return self._client
        if self._carla is None:
            self._carla = _carla_package()
        address = f"{self._settings.carla_host}:{self._settings.carla_port}"
        with server_errors(f"connecting to {address}"):
            client = self._carla.Client(self._settings.carla_host, self._settings.carla_port)
            client.set_timeout(_TIMEOUT_S)
            server, package = client.get_server_version(), client.get_client_version()
        release = server.split("-")[0]
        if release not in SUPPORTED_VERSIONS:
            raise Failure(f"CARLA at {address} is version {server}; {' and '.join(SUPPORTED_VERSIONS)} are supported")
        if release != package.split("-")[0]:
            raise Failure(
                f"CARLA at {address} is version {server}, the installed carla package {package}; they must be the "
                f"same: install carla {release} (from PyPI, or the wheel in the server's PythonAPI folder), or start "
                f"the server of the package's version"
            )
        self._client, self.version = client, server
        return client
