"""Traffic around a crash, simulated by SUMO: it sees the parties and reacts to them, but does not change the crash.

The network is first filled without the parties. Then each party is placed as in the crash at every step (TraCI's
``moveToXY``), and SUMO drives all others. A vehicle that would overlap a party, or an earlier vehicle, is left out and
the simulation is repeated, until there is no overlap. So the parties' motion is exactly that of the crash, and no other
vehicle touches them.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import socket
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np
from lxml import etree

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import mps_to_kmh
from trace_dag.crash.record import VehicleClass
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.lights import Lights, Party
from trace_dag.scenario.traffic.demand import Streets, Trip, routes_xml, types_xml
from trace_dag.scenario.traffic.sumo_network import SUMO_PARSER, network_xml, programs_xml, sumo_homes, sumo_program
from trace_dag.scenario.traffic.surrounding import (
    STEP_S,
    Measured,
    SurroundingTraffic,
    SurroundingVehicle,
    body_of_class,
    overlapping,
)
from trace_dag.scenario.traffic.volumes import Hour, TrafficClass, hourly_volume
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import SimulationLog

_FILLING_S: Final = 240.0  # before the crash begins
_MEASURED_S: Final = 60.0  # the last of them
_FILLING_STEP_S: Final = 0.5
_ANYWHERE: Final = 6  # moveToXY: off the network too (2), whatever a lane permits (4)
_DECIMALS: Final = 3  # a millimetre, a milliradian
_ATTEMPTS, _WAIT_S = 1000, 0.02  # to connect
_SEEN_BEFORE_S: Final = 3.0
"""Time before a crash begins from which the parties are there, on their way: who follows can keep a distance."""
_PROGRAM_OPTIONS: Final = (
    *("--no-step-log", "true", "--no-warnings", "true", "--collision.action", "none", "--time-to-teleport", "-1"),
    *("--lanechange.duration", "3", "--seed", "1", "--begin", "0"),
)
"""Lanes are changed in 3 s. With the sublane model, which also moves vehicles within lanes, SUMO 1.28.0 gives other
traffic from one run to the next, of the same loaded state and seed, unless addresses of memory are the same."""


@dataclass(frozen=True)
class TrafficRequest:
    """The request for traffic: ``factor`` scales the tables' volumes; equal requests give equal traffic."""

    factor: float = 1.0
    seed: int = 1


def surround(
    key: str,
    network: RoadNetwork,
    xodr: bytes,
    log: SimulationLog,
    at: Hour,
    request: TrafficRequest,
    lights: Lights | None = None,
) -> SurroundingTraffic:
    """Return the traffic around a simulated crash (``log``) at an hour.

    Raises :class:`UserError` without SUMO, and :class:`Failure` if SUMO fails.
    """
    net = network_xml(sumo_program("netconvert"), key, network, xodr)
    read = etree.fromstring(net, SUMO_PARSER)
    streets, programs = Streets(read, network), programs_xml(read, lights, begins_s=_FILLING_S)
    trips = streets.trips(at, from_s=-_FILLING_S, until_s=log.duration_s, factor=request.factor, seed=request.seed)
    parties = {each.number: Party(log.bodies[each.number], each) for each in log.vehicles}
    times = np.arange(0.0, log.duration_s + STEP_S / 2, STEP_S)
    poses = {number: (each.body, each.poses_at(times)) for number, each in parties.items()}
    left_out: set[int] = set()
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "lights.add.xml").write_bytes(programs)
        run = _Run(key, Path(folder), net, trips, parties)
        measured = run.fill(streets, at, request.factor)
        while True:
            vehicles = run.vehicles(log.duration_s, left_out)
            touched = overlapping(vehicles, poses, times)
            if not touched:
                return SurroundingTraffic(tuple(vehicles), len(left_out), measured)
            if touched <= left_out:
                raise Failure(f"{key}: SUMO inserts vehicles that it was not given: {sorted(touched)}")
            left_out |= touched


class _Run:
    """SUMO on one network with the trips of a request, in a folder of its own."""

    def __init__(self, key: str, folder: Path, net: bytes, trips: Sequence[Trip], parties: Mapping[int, Party]) -> None:
        self._key, self._folder, self._parties = key, folder, parties
        self._trips = {each.number: each for each in trips}
        (folder / "map.net.xml").write_bytes(net)
        bodies = {_name(number): each.body for number, each in parties.items()}
        (folder / "types.add.xml").write_bytes(types_xml(bodies))
        (folder / "trips.rou.xml").write_bytes(routes_xml(trips, begins_s=-_FILLING_S))

    def fill(self, streets: Streets, at: Hour, factor: float) -> tuple[Measured, ...]:
        """Fill the network without the parties, to shortly before they appear; return the traffic then, by class."""
        until_s = _FILLING_S - _SEEN_BEFORE_S
        options = ("--save-state.rng", "true", "--save-state.times", f"{until_s:g}", "--save-state.files", "full.xml")
        aside = ("--fcd-output", "fcd.xml", "--fcd-output.attributes", "speed,lane")
        command = [*self._command(_FILLING_STEP_S), *options, *aside, "--end", f"{until_s + _FILLING_STEP_S:g}"]
        done = subprocess.run(command, cwd=self._folder, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            raise Failure(f"{self._key}: SUMO failed: {' '.join(done.stderr.split())[-300:]}")
        found = etree.parse(self._folder / "fcd.xml", SUMO_PARSER).getroot()
        moments = [each for each in found if float(each.get("time", "0")) >= until_s - _MEASURED_S]
        return tuple(_measured(streets, moments, at, factor))

    def vehicles(self, duration_s: float, without: Collection[int]) -> list[SurroundingVehicle]:
        """Return the vehicles during the crash, without some of them."""
        kept = [each for number, each in self._trips.items() if number not in without]
        (self._folder / "trips.rou.xml").write_bytes(routes_xml(kept, begins_s=-_FILLING_S))
        steps = round((_SEEN_BEFORE_S + duration_s) / STEP_S)
        times: FloatArray = np.arange(1, steps + 1, dtype=np.float64) * STEP_S - _SEEN_BEFORE_S
        ways = {number: each.front_at(times) for number, each in self._parties.items()}
        rows: dict[int, list[tuple[float, ...]]] = defaultdict(list)
        with self._connected([*self._command(STEP_S), "--load-state", "full.xml"]) as sumo:
            constants = load_traci().constants
            wanted = {constants.VAR_POSITION3D, constants.VAR_ANGLE, constants.VAR_SPEED}
            for number in self._parties:
                sumo.vehicle.add(_name(number), "", typeID=_name(number))
            came, gone = sumo.vehicle.getIDList(), {str(number) for number in without}
            for step, time_s in enumerate(times):
                for name in filter(str.isdecimal, came):
                    if name in gone:  # it was on the filled network, or waited to come onto it
                        sumo.vehicle.remove(name)
                    else:
                        sumo.vehicle.subscribe(name, wanted)
                for number, way in ways.items():
                    sumo.vehicle.moveToXY(_name(number), "", -1, *map(float, way[step]), keepRoute=_ANYWHERE)
                sumo.simulationStep()
                came = sumo.simulation.getDepartedIDList()
                if time_s > -STEP_S / 2:
                    for name, said in sumo.vehicle.getAllSubscriptionResults().items():
                        x, y, z = said[constants.VAR_POSITION3D]
                        row = (time_s, x, y, z, said[constants.VAR_ANGLE], said[constants.VAR_SPEED])
                        rows[int(name)].append(row)
        return [_vehicle(number, self._trips[number].vehicle_class, np.array(rows[number])) for number in sorted(rows)]

    def _command(self, step_s: float) -> list[str]:
        files = (
            "--net-file",
            "map.net.xml",
            "--additional-files",
            "types.add.xml,lights.add.xml",
            "--route-files",
            "trips.rou.xml",
        )
        return [sumo_program("sumo"), *files, "--step-length", f"{step_s:g}", *_PROGRAM_OPTIONS]

    @contextlib.contextmanager
    def _connected(self, command: list[str]) -> Iterator[Any]:
        """Run SUMO and yield the connection to it. Raises :class:`Failure` if it stops."""
        traci = load_traci()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        told = (self._folder / "told.txt").open("w+")
        process = subprocess.Popen(  # noqa: S603 - SUMO's own program
            [*command, "--remote-port", str(port)], cwd=self._folder, stdout=subprocess.DEVNULL, stderr=told
        )
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it reports every attempt
                sumo = traci.main.connect(port, numRetries=_ATTEMPTS, proc=process, waitBetweenRetries=_WAIT_S)
            yield sumo
            sumo.close()
        except (traci.exceptions.FatalTraCIError, traci.exceptions.TraCIException) as error:
            told.seek(0)
            raise Failure(f"{self._key}: SUMO failed: {error} {' '.join(told.read().split())[-300:]}") from error
        finally:
            process.kill()
            process.wait()
            told.close()


def _name(party: int) -> str:
    return f"party{party}"


def _vehicle(number: int, vehicle_class: VehicleClass, rows: FloatArray) -> SurroundingVehicle:
    """Return a vehicle from rows of time, x, y and z of the middle of its front, degrees from north, and speed."""
    time_s, x, y, z, angle_deg, speed = rows.T
    body, heading = body_of_class(vehicle_class), np.radians(90.0 - angle_deg)
    back_m = body.length_m / 2
    columns = (time_s, x - back_m * np.cos(heading), y - back_m * np.sin(heading), z, heading, speed)
    return SurroundingVehicle(number, body, Trajectory(*(each.round(_DECIMALS) for each in columns)))


def _measured(streets: Streets, moments: Sequence[etree._Element], at: Hour, factor: float) -> Iterator[Measured]:
    """Yield the measures of each class present, by Edie's definitions over all its lanes and moments."""
    speeds: dict[TrafficClass, list[float]] = defaultdict(list)
    for each in (vehicle for moment in moments for vehicle in moment):
        edge = streets.edges.get(each.get("lane", "").rpartition("_")[0])
        if edge is not None and edge.traffic_class is not None:
            speeds[edge.traffic_class].append(float(each.get("speed", "0")))
    for of in TrafficClass:
        edges = [each for each in streets.edges.values() if each.traffic_class is of]
        lane_km = sum(each.lanes * each.length_m for each in edges) / 1000
        if not edges or not moments:
            continue
        there = len(speeds[of])
        mean_mps = sum(speeds[of]) / there if there else None
        density = there / len(moments) / lane_km
        limit_mps = sum(each.lanes * each.length_m * each.limit_mps for each in edges) / (1000 * lane_km)
        volume = density * mps_to_kmh(mean_mps or 0.0)
        yield Measured(of, lane_km, factor * hourly_volume(of, at), limit_mps, volume, mean_mps, density)


def load_traci() -> ModuleType:
    """Return SUMO's TraCI, which is in a folder of the program.

    Raises :class:`UserError` if it is missing.
    """
    for home in sumo_homes():
        if str(home / "tools") not in sys.path:
            sys.path.append(str(home / "tools"))
    try:
        return importlib.import_module("traci")
    except ImportError as error:
        raise UserError(
            "SUMO's traci is needed and not here: pip install 'trace-dag[sumo]', or set SUMO_HOME"
        ) from error
