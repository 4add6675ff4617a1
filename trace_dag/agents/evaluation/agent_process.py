"""An agent of somebody else, driven from here and running in a process of its own.

The loop treats it like any other agent. Its resources are limited. Any fault, also the end of its process, raises
:class:`AgentFault`; its process is then ended with everything it started, and the next scenario begins in a new one.
"""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, fields, replace
from typing import IO

from trace_dag.agents.evaluation.agent_main import AgentLimits, Reset, Start
from trace_dag.agents.evaluation.agent_protocol import (
    LENGTH,
    MOST_PATH_POINTS,
    NO_ANSWER,
    READY,
    add_length,
    answer_from_bytes,
    one_line,
)
from trace_dag.agents.evaluation.agents import Action, AgentFault, Observation
from trace_dag.agents.evaluation.isolation import Isolation
from trace_dag.common.processes import descendants, end_all, how_it_ended, processor_time_s
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.cases import Scenario

WAITS = 5
"""So many times its limit of processor time an agent may take in all, on a loaded machine or asleep."""
_START_S = 60.0  # for Python and this package to be there
_MOST_BYTES = 1000 + 60 * MOST_PATH_POINTS  # of an answer
_END_S = 1.0
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_LOOK_EVERY_S = 0.2  # at the processes it has started
_SHOWN_CHARACTERS = 10_000  # of what it prints in an evaluation


@dataclass(frozen=True)
class _Life:
    """A process, the socket to it, and what it prints (not blocking)."""

    process: subprocess.Popen[bytes]
    connection: socket.socket
    output: IO[bytes]

    def exit_code(self) -> int | None:
        """Return the exit code, or None if the process is still running after a second."""
        try:
            return self.process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            return None


class AgentProcess:
    """An agent, as ``module:Class`` with its arguments, in a process of its own.

    An :class:`trace_dag.agents.evaluation.agents.Agent` whose methods raise :class:`AgentFault`.

    With an ``isolation`` the process sees no network, no other process, and of the files only what Python and the agent
    need, none of which it can change.
    """

    def __init__(self, reference: str, limits: AgentLimits, isolation: Isolation | None = None) -> None:
        self._reference = reference
        self._limits = limits
        self._isolation = isolation
        self._life: _Life | None = None
        self._network: RoadNetwork | None = None  # the one its process has

    def make(self) -> None:
        """Start the process and make the agent in it, unless that is done. Raises :class:`AgentFault`."""
        if self._life is not None:
            return
        self._life = _started(self._isolation)
        self._network = None
        self._printed = 0
        self._look_at_s = 0.0
        self._begin(_START_S)
        self._expect_ready(self._heard())
        self._begin(self._limits.time_s)
        self._expect_ready(self._asked(Start(self._reference, self._limits, tuple(sys.path))))

    def reset(self, scenario: Scenario) -> None:
        """See :class:`trace_dag.agents.evaluation.agents.Agent`. From here on the time of an evaluation runs."""
        self.make()
        self._look()
        self._begin(self._limits.time_s)
        network = scenario.lane_map.network
        told = {each.name: getattr(scenario, each.name) for each in fields(scenario)}
        del told["lane_map"]
        asked = Reset(None if network is self._network else _pickled(network), told)
        self._network = network
        self._expect_ready(self._asked(asked))

    def act(self, observation: Observation) -> Action:
        return self._read(self._asked(observation))

    def close(self) -> None:
        """End the process and everything that it started."""
        life, self._life = self._life, None
        if life is None:
            return
        end_all(life.process.pid)
        life.exit_code()
        life.connection.close()
        assert life.process.stdin is not None
        life.process.stdin.close()
        life.output.close()

    def _begin(self, limit_s: float) -> None:
        self._limit_s, self._began_s = limit_s, time.monotonic()
        self._used_s = processor_time_s(self._alive.process.pid)
        self._printed = 0

    def _read(self, answer: bytes) -> Action:
        try:
            return answer_from_bytes(answer)
        except AgentFault:
            self.close()
            raise

    def _expect_ready(self, answer: bytes) -> None:
        if answer != READY:
            self._read(answer)
            raise self._ended(NO_ANSWER)

    def _asked(self, message: Start | Reset | Observation) -> bytes:
        """Return the answer to a message.

        Raises :class:`AgentFault`.
        """
        data = memoryview(add_length(pickle.dumps(message)))
        while data:
            try:
                data = data[self._alive.connection.send(data) :]
            except TimeoutError:  # it has not read for a while
                self._look()
            except OSError:
                break  # it is gone: listening to it says how
        return self._heard()

    def _heard(self) -> bytes:
        """Return the agent's next message; an agent may send one at a time.

        Raises :class:`AgentFault`.
        """
        data, wanted = b"", LENGTH.size
        if time.monotonic() > self._look_at_s:
            self._look()
        while len(data) < wanted:
            try:
                part = self._alive.connection.recv(1 << 16)
            except TimeoutError:
                self._look()
                continue
            except OSError:
                part = b""
            if not part:
                raise self._ended(self._how_it_left())
            data += part
            if len(data) >= LENGTH.size:
                wanted = LENGTH.size + LENGTH.unpack_from(data)[0]
                if wanted > _MOST_BYTES or len(data) > wanted:
                    raise self._ended(NO_ANSWER)
        return data[LENGTH.size :]

    def _look(self) -> None:
        """Check the time limit, output and processes of the agent: at every wait, and otherwise now and then."""
        now_s = time.monotonic()
        if processor_time_s(self._alive.process.pid) - self._used_s > self._limit_s:
            raise self._ended(f"took longer than {self._limit_s:g} s of processor time")
        if now_s - self._began_s > WAITS * self._limit_s:
            raise self._ended(f"took longer than {WAITS * self._limit_s:g} s")
        self._look_at_s = now_s + _LOOK_EVERY_S
        self._take_output()
        if len(descendants(self._alive.process.pid)) > self._limits.processes:
            raise self._ended(f"started more than the {self._limits.processes} processes that are allowed")

    def _take_output(self) -> None:
        """Print the agent's output up to a limit, without control characters that could disturb the terminal."""
        part = self._alive.output.read(1 << 20) or b""  # None: nothing for now
        if self._printed < _SHOWN_CHARACTERS:
            for line in part[: _SHOWN_CHARACTERS - self._printed].decode(errors="replace").splitlines():
                print(one_line(line), file=sys.stderr)  # noqa: T201 - an author looks for it there
        self._printed += len(part)
        if self._printed > 1024 * self._limits.output_kb:
            raise self._ended(f"printed more than {self._limits.output_kb} kB")

    def _how_it_left(self) -> str:
        code = self._alive.exit_code()
        return "closed its channel" if code is None else f"ended its process ({how_it_ended(code)})"

    @property
    def _alive(self) -> _Life:
        assert self._life is not None
        return self._life

    def _ended(self, how: str) -> AgentFault:
        """End the agent's process and return the fault."""
        self.close()
        return AgentFault(how)


def _started(isolation: Isolation | None) -> _Life:
    """Return a process that waits for the first message of :mod:`trace_dag.agents.evaluation.agent_main`."""
    ours, theirs = socket.socketpair()
    ours.settimeout(_LOOK_EVERY_S)  # nothing else of the agent is looked at for longer than that
    code = f"from trace_dag.agents.evaluation.agent_main import main; main({theirs.fileno()})"
    command, environment = [sys.executable, "-P", "-c", code], {**_ONE_THREAD, **os.environ}
    if isolation is not None:
        command, environment = isolation.command(command), isolation.environment(environment)
    with theirs:
        process = subprocess.Popen(  # noqa: S603 - our own command
            command,
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
            env=environment,
        )
    assert process.stdout is not None
    os.set_blocking(process.stdout.fileno(), False)
    return _Life(process, ours, process.stdout)


_last_pickled: tuple[RoadNetwork | None, bytes] = (None, b"")


def _pickled(network: RoadNetwork) -> bytes:
    """Return a map as bytes; the latest result is kept for other agents in the same map."""
    global _last_pickled
    if _last_pickled[0] is not network:
        _last_pickled = network, pickle.dumps(replace(network))  # without what it keeps of earlier questions
    return _last_pickled[1]
