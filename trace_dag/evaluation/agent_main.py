"""The process an agent lives in, started by :mod:`trace_dag.evaluation.agent_process`.

It holds nothing but the agent and one end of a socket: what is measured, and everything that is stored, is on the other
side. It takes its limits upon itself before any code of the agent runs. Messages to here are pickled, by us; messages
from here are plain bytes (:mod:`trace_dag.evaluation.wire`).
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, NoReturn

from trace_dag.evaluation.agents import Agent, AgentFault, Scenario
from trace_dag.evaluation.lane_map import LaneMap
from trace_dag.evaluation.registry import make_agent
from trace_dag.evaluation.wire import (
    AnswerWriter,
    described,
    fault_to_bytes,
    framed,
    observation_from_bytes,
    received,
)
from trace_dag.processes import children, end_all

if TYPE_CHECKING:
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.sim.vehicles import VehicleModel
    from trace_dag.states.paths import Path

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # prctl(2)


@dataclass(frozen=True)
class AgentLimits:
    """What an agent may take.

    ``time_s``: wall-clock time of one evaluation, and of making the agent. ``memory_mb``: address space of each of its
    processes beyond what Python and this package take. ``processes``: itself, its threads not counted. ``files``: open
    at once, of at most ``file_mb`` each. ``output_kb``: of what it prints in an evaluation.
    """

    time_s: float = 20.0
    memory_mb: int = 2048
    processes: int = 64
    files: int = 256
    file_mb: int = 64
    output_kb: int = 1024


@dataclass(frozen=True)
class Start:
    """The first message: which agent, and under which limits. ``import_from`` is ``sys.path``."""

    reference: str
    limits: AgentLimits
    import_from: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Reset:
    """A new scenario. ``network`` is the pickled map, None where it is the one of the scenario before."""

    network: bytes | None
    vehicle: VehicleModel
    route: Path
    recorded_path: Path
    period_s: float
    friction: float
    seed: int


class _LaneMapOnDemand(LaneMap):
    """A lane map that is read when the agent first asks for it: half of all agents never do."""

    def __init__(self, pickled: bytes) -> None:
        object.__setattr__(self, "_pickled", pickled)

    _pickled: bytes

    @cached_property
    def network(self) -> RoadNetwork:
        network: RoadNetwork = pickle.loads(self._pickled)  # noqa: S301 - from our own side
        return network


def nursery(number: int) -> None:
    """Fork a process for each agent asked for by a socket, and tell how each ended, until the other side hangs up."""
    control = socket.socket(fileno=number)
    _belong_to_parent()
    agents: dict[int, int | None] = {}  # and their exit codes
    while True:
        message, handles, _, _ = socket.recv_fds(control, 64, 2)
        if not message:
            return
        if handles:
            child = os.fork()
            if not child:
                control.close()
                _become_agent(*handles)
            agents[child] = None
            for handle in handles:
                os.close(handle)
            control.sendall(f"{child}\n".encode())
        else:
            asked, wait_s = message.split()
            control.sendall(_exit_code(agents, int(asked), float(wait_s)) + b"\n")


def _become_agent(connection: int, output: int) -> NoReturn:
    """What a forked process does."""
    os.setsid()
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.close(output)
    try:
        main(connection)
    finally:
        os._exit(0)


def _exit_code(agents: dict[int, int | None], asked: int, wait_s: float) -> bytes:
    """The exit code of an agent's process, or that it still runs; what it left behind is ended."""
    until_s = time.monotonic() + wait_s
    while True:
        with suppress(ChildProcessError):
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                if ended[0] in agents:
                    agents[ended[0]] = os.waitstatus_to_exitcode(ended[1])
        strays = [child for child in children(os.getpid()) if child not in agents]
        for stray in strays:
            end_all(stray)
        if agents[asked] is not None and not strays:
            return str(agents[asked]).encode()
        if time.monotonic() > until_s:
            return b"runs"
        time.sleep(0.002)


def main(number: int) -> None:
    """Serve one agent by an open socket until the other side hangs up."""
    connection = socket.socket(fileno=number)
    _belong_to_parent()
    connection.sendall(framed(b"K"))
    start: Start = pickle.loads(received(connection))  # noqa: S301 - from our own side
    sys.path[:] = start.import_from
    _limit(start.limits)
    try:
        agent = make_agent(start.reference)
    except AgentFault as fault:
        connection.sendall(framed(fault_to_bytes(str(fault))))
        return
    connection.sendall(framed(b"K"))
    with suppress(EOFError):
        _serve(connection, agent)


def _serve(connection: socket.socket, agent: Agent) -> None:
    writer, lane_map = AnswerWriter(), None
    while True:
        message = received(connection)
        try:
            if message[:1] == b"O":
                answer = writer.to_bytes(agent.act(observation_from_bytes(message[1:])))
            else:
                asked: Reset = pickle.loads(message[1:])  # noqa: S301 - from our own side
                if asked.network is not None:
                    lane_map = _LaneMapOnDemand(asked.network)
                if lane_map is None:
                    raise AgentFault("no map has come")
                agent.reset(_scenario(asked, lane_map))
                answer = b"K"
        except BaseException as error:  # KeyboardInterrupt and SystemExit, too, are its doing
            answer = fault_to_bytes(described(error))
        connection.sendall(framed(answer))


def _scenario(asked: Reset, lane_map: LaneMap) -> Scenario:
    return Scenario(
        vehicle=asked.vehicle,
        lane_map=lane_map,
        route=asked.route,
        recorded_path=asked.recorded_path,
        period_s=asked.period_s,
        friction=asked.friction,
        seed=asked.seed,
    )


def _belong_to_parent() -> None:
    """Die with the process that measures, and be the parent of whatever the agent starts and abandons."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command, which ends its agents itself
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        libc.prctl(_PR_SET_CHILD_SUBREAPER, 1)


def _limit(limits: AgentLimits) -> None:
    """Take limits upon this process that it cannot lift again (but as root)."""
    statm = FilePath("/proc/self/statm")
    if statm.exists():
        own = int(statm.read_text().split()[0]) * resource.getpagesize()
        _set(resource.RLIMIT_AS, own + limits.memory_mb * 2**20)
    _set(resource.RLIMIT_NOFILE, limits.files)
    _set(resource.RLIMIT_FSIZE, limits.file_mb * 2**20)
    _set(resource.RLIMIT_CORE, 0)
    # Of all processes and threads of the user, so that this one cannot be exact: it stops a bomb before it is ended.
    _set(resource.RLIMIT_NPROC, _of_this_user() + 8 * limits.processes)


def _set(what: int, value: int) -> None:
    with suppress(OSError, ValueError):  # not everywhere: no limit is better than no agent
        hard = resource.getrlimit(what)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(what, (value, value))


def _of_this_user() -> int:
    """How many threads this user has."""
    found = 0
    for each in FilePath("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if each.stat().st_uid == os.getuid():
                found += sum(1 for _ in (each / "task").iterdir())
    return found
