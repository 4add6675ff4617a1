"""An agent of somebody else, driven from here and running in a process of its own.

To the loop it is an agent like any other. What its process may take is limited, and whatever it does wrong, its own end
included, is an :class:`AgentFault`; its process is then ended with everything it started, and the next scenario begins
in a new one.
"""

from __future__ import annotations

import pickle
import socket
import struct
import sys
import time
from dataclasses import replace

from trace_dag.evaluation.agent_birth import Life, born
from trace_dag.evaluation.agent_main import AgentLimits, Reset, Start
from trace_dag.evaluation.agents import Action, AgentFault, Observation, Scenario
from trace_dag.evaluation.isolation import Isolation
from trace_dag.evaluation.wire import (
    HEAD_BYTES,
    MOST_PATH_POINTS,
    AnswerReader,
    framed,
    length_of,
    observation_to_bytes,
    one_line,
)
from trace_dag.processes import descendants, end_all, how_it_ended
from trace_dag.roads.map.network import RoadNetwork

_START_S = 60.0  # for Python and this package to be there
_MOST_BYTES = 64 + 16 * MOST_PATH_POINTS
_LOOK_EVERY_S = 0.2  # at the processes it has started
_SHOWN_CHARACTERS = 10_000  # of what it prints in an evaluation


class AgentProcess:
    """An agent, as ``module:Class`` with its arguments, in a process of its own: an
    :class:`trace_dag.evaluation.agents.Agent` whose methods raise :class:`AgentFault`.

    With an ``isolation`` the process sees no network, no other process, and of the files only what Python and the agent
    need, none of which it can change.
    """

    def __init__(self, reference: str, limits: AgentLimits, isolation: Isolation | None = None) -> None:
        self._reference = reference
        self._limits = limits
        self._isolation = isolation
        self._life: Life | None = None
        self._network: RoadNetwork | None = None  # the one its process has
        self._deadline_s = 0.0

    def make(self) -> None:
        """Start the process and make the agent in it, if that has not been done. Raises :class:`AgentFault`."""
        if self._life is not None:
            return
        self._life = life = born(self._isolation)
        self._reader = AnswerReader()
        self._network = None
        self._printed = 0
        self._look_at_s = 0.0
        # Blocking, but not for longer than that: nothing else of the agent is looked at meanwhile.
        patience = struct.pack("@ll", 0, int(1e6 * _LOOK_EVERY_S))
        for direction in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            life.connection.setsockopt(socket.SOL_SOCKET, direction, patience)
        self._begin(_START_S)
        self._heard()
        self._begin(self._limits.time_s)
        start = Start(self._reference, self._limits, tuple(sys.path))
        if self._asked(pickle.dumps(start)) != b"K":
            raise self._ended("answered bytes that are not an answer")

    def reset(self, scenario: Scenario) -> None:
        """See :class:`trace_dag.evaluation.agents.Agent`. From here on the time of an evaluation runs."""
        self.make()
        self._look()
        self._begin(self._limits.time_s)
        network = scenario.lane_map.network
        asked = Reset(
            network=None if network is self._network else _pickled(network),
            vehicle=scenario.vehicle,
            route=scenario.route,
            recorded_path=scenario.recorded_path,
            period_s=scenario.period_s,
            friction=scenario.friction,
            seed=scenario.seed,
        )
        self._network = network
        if self._asked(b"S" + pickle.dumps(asked)) != b"K":
            raise self._ended("answered bytes that are not an answer")

    def act(self, observation: Observation) -> Action:
        """See :class:`trace_dag.evaluation.agents.Agent`."""
        answer = self._asked(b"O" + observation_to_bytes(observation))
        try:
            return self._reader.from_bytes(answer)
        except AgentFault:
            self.close()
            raise

    def close(self) -> None:
        """End the process and everything it has started."""
        life, self._life = self._life, None
        if life is None:
            return
        end_all(life.number)
        life.exit_code()
        life.connection.close()
        life.output.close()

    def _begin(self, limit_s: float) -> None:
        self._deadline_s, self._limit_s = time.monotonic() + limit_s, limit_s
        self._printed = 0

    def _asked(self, message: bytes) -> bytes:
        """The answer to a message. Raises :class:`AgentFault`."""
        data = memoryview(framed(message))
        while data:
            try:
                data = data[self._alive.connection.send(data) :]
            except BlockingIOError:  # it has not read for a while
                self._look()
            except OSError:
                break  # it is gone: listening to it says how
        answer = self._heard()
        if answer[:1] == b"F":
            self.close()
            self._reader.from_bytes(answer)
        return answer

    def _heard(self) -> bytes:
        """The next message of the agent, of which it may send one at a time. Raises :class:`AgentFault`."""
        data, wanted = b"", HEAD_BYTES
        if time.monotonic() > self._look_at_s:
            self._look()
        while len(data) < wanted:
            try:
                part = self._alive.connection.recv(4096)
            except BlockingIOError:
                self._look()
                continue
            except OSError:
                part = b""
            if not part:
                raise self._ended(self._how_it_left())
            data = data + part if data else part
            length = length_of(data)
            wanted = HEAD_BYTES + (length or 0)
            if length is not None and (length > _MOST_BYTES or len(data) > wanted):
                raise self._ended("answered bytes that are not an answer")
        return data[HEAD_BYTES:]

    def _look(self) -> None:
        """Look at the clock, at what the agent prints, and at its processes: while it does not answer, and now and then
        where it does."""
        now_s = time.monotonic()
        if now_s > self._deadline_s:
            raise self._ended(self._too_long)
        self._look_at_s = now_s + _LOOK_EVERY_S
        self._take_output()
        if len(descendants(self._alive.number)) >= self._limits.processes:
            raise self._ended(f"started more than the {self._limits.processes} processes that are allowed")

    def _take_output(self) -> None:
        """Show what the agent prints, up to a limit, in a way that cannot spoil what else the terminal shows."""
        part = self._alive.output.read(1 << 20) or b""  # None: nothing for now
        if self._printed < _SHOWN_CHARACTERS:
            for line in part[: _SHOWN_CHARACTERS - self._printed].decode(errors="replace").splitlines():
                print(one_line(line), file=sys.stderr)  # noqa: T201 - an author looks for it there
        self._printed += len(part)
        if self._printed > 1024 * self._limits.output_kb:
            raise self._ended(f"printed more than {self._limits.output_kb} kB")

    @property
    def _too_long(self) -> str:
        return f"took longer than {self._limit_s:g} s"

    def _how_it_left(self) -> str:
        code = self._alive.exit_code()
        return "closed its channel" if code is None else f"ended its process ({how_it_ended(code)})"

    @property
    def _alive(self) -> Life:
        assert self._life is not None
        return self._life

    def _ended(self, how: str) -> AgentFault:
        """The fault of an agent whose process is ended for it."""
        self.close()
        return AgentFault(how)


_last_pickled: tuple[RoadNetwork | None, bytes] = (None, b"")


def _pickled(network: RoadNetwork) -> bytes:
    """A map as bytes; of the latest one they are kept, for the other agents that drive in it."""
    global _last_pickled
    if _last_pickled[0] is not network:
        _last_pickled = network, pickle.dumps(replace(network))  # without what it keeps of earlier questions
    return _last_pickled[1]
