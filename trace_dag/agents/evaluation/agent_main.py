"""The process an agent lives in, started by :mod:`trace_dag.agents.evaluation.agent_process`.

It holds only the agent and one end of a socket; measuring and storing happen on the other side. It limits its own
resources before any code of the agent runs. The agent's parent is a guardian process that only waits for it, so an
agent that kills its parent does not stop the measuring process. For the messages see
:mod:`trace_dag.agents.evaluation.agent_protocol`.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
import socket
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BufferedRWPair
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from trace_dag.agents.evaluation.agent_protocol import (
    LENGTH,
    READY,
    add_length,
    answer_to_bytes,
    describe_exception,
    fault_to_bytes,
)
from trace_dag.agents.evaluation.agents import Agent, AgentFault, Observation
from trace_dag.agents.evaluation.registry import make_agent
from trace_dag.common.processes import children, end_all
from trace_dag.roads.map.lane_map import LaneMap
from trace_dag.scenario.cases import Scenario

if TYPE_CHECKING:
    from trace_dag.roads.map.network import RoadNetwork

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # prctl(2)


@dataclass(frozen=True)
class AgentLimits:
    """Limits of an agent's process: time, memory, threads.

    ``time_s``: processor time of one evaluation, and of making the agent. ``memory_mb``: address space of each of its
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
    """A new scenario. ``network`` is the pickled map, or None if the map has not changed.

    ``rest`` has the other arguments by name.
    """

    network: bytes | None
    rest: Mapping[str, Any]


class _LaneMapOnDemand(LaneMap):
    """A lane map that is read when the agent first uses it; half of all agents never do."""

    def __init__(self, pickled: bytes) -> None:
        object.__setattr__(self, "_pickled", pickled)

    _pickled: bytes

    @cached_property
    def network(self) -> RoadNetwork:
        network: RoadNetwork = pickle.loads(self._pickled)  # noqa: S301 - from our own side
        return network


def main(number: int) -> None:
    """Serve one agent over an open socket until the other side closes it."""
    _go_on_guarded(number)
    with socket.socket(fileno=number) as connection, connection.makefile("rwb") as channel:
        _send(channel, READY)
        start: Start = _received(channel)
        sys.path[:] = start.import_from
        _limit(start.limits)
        try:
            agent = make_agent(start.reference)
        except AgentFault as fault:
            _send(channel, fault_to_bytes(str(fault)))
            return
        _send(channel, READY)
        with suppress(EOFError):
            _serve(channel, agent)


def _serve(channel: BufferedRWPair, agent: Agent) -> None:
    lane_map = None
    while True:
        asked: Observation | Reset = _received(channel)
        try:
            if isinstance(asked, Observation):
                answer = answer_to_bytes(agent.act(asked))
            else:
                if asked.network is not None:
                    lane_map = _LaneMapOnDemand(asked.network)
                if lane_map is None:
                    raise AgentFault("no map has come")
                agent.reset(Scenario(lane_map=lane_map, **asked.rest))
                answer = READY
        except BaseException as error:  # KeyboardInterrupt and SystemExit, too, are its doing
            answer = fault_to_bytes(describe_exception(error))
        _send(channel, answer)


def _send(channel: BufferedRWPair, message: bytes) -> None:
    channel.write(add_length(message))
    channel.flush()


def _received(channel: BufferedRWPair) -> Any:
    """Return the next message from the measuring process.

    Raises :class:`EOFError` once that process is gone.
    """
    head = channel.read(LENGTH.size)
    if len(head) < LENGTH.size:
        raise EOFError
    return pickle.loads(channel.read(LENGTH.unpack(head)[0]))  # noqa: S301 - from our own side


def _go_on_guarded(number: int) -> None:
    """Fork: return in the child; the parent waits, ends the child's leftover processes, and exits as the child did.

    It also ends the child if the measuring process, which holds the other end of standard input, is gone.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the command, which ends its agents itself
    _ask_kernel(_PR_SET_CHILD_SUBREAPER, 1)  # the parent of whatever the agent starts and abandons
    child = os.fork()
    if not child:
        _ask_kernel(_PR_SET_PDEATHSIG, signal.SIGKILL)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        return
    os.close(number)
    threading.Thread(target=_end_with_who_measures, args=(child,), daemon=True).start()
    ended, status = os.wait()
    while ended != child:
        ended, status = os.wait()
    while strays := children(os.getpid()):
        for stray in strays:
            end_all(stray)
        os.wait()
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        signal.signal(-code, signal.SIG_DFL) if -code != signal.SIGKILL else None
        os.kill(os.getpid(), -code)
    os._exit(code)


def _end_with_who_measures(child: int) -> None:
    os.read(0, 1)  # nothing is ever written there
    end_all(child)


def _ask_kernel(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value)


def _limit(limits: AgentLimits) -> None:
    """Limit this process's resources; only root could lift the limits again."""
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
    """Return the number of threads of this user."""
    found = 0
    for each in FilePath("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if each.stat().st_uid == os.getuid():
                found += sum(1 for _ in (each / "task").iterdir())
    return found
