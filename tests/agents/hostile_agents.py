"""Agents that do what no agent should. Each is driven in a process of its own by the tests beside."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from trace_dag.agents.evaluation.agents import Action, Motion, Observation, Recorded
from trace_dag.scenario.cases import Scenario
from trace_dag.simulation.driving import Pedals


class Harmless:
    def reset(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def act(self, observation: Observation) -> Action:
        return Recorded()


class Answering(Harmless):
    """Answers what the expression says."""

    def __init__(self, answer: str) -> None:
        self.answer = eval(answer, {"np": np, "Motion": Motion, "Pedals": Pedals, "nan": float("nan")})

    def act(self, observation: Observation) -> Action:
        return self.answer


class Interrupting(Harmless):
    def act(self, observation: Observation) -> Action:
        raise KeyboardInterrupt


class Looping(Harmless):
    def act(self, observation: Observation) -> Action:
        while True:
            pass


class Stopping(Harmless):
    """Stops the process that started it, which it may: they belong to one user."""

    def __init__(self, then: str = "") -> None:
        self.then = then

    def act(self, observation: Observation) -> Action:
        os.kill(os.getppid(), signal.SIGSTOP)
        while self.then == "loop":
            pass
        return Recorded()


class Unsharing(Harmless):
    """Makes a user namespace, in which it would have all rights."""

    def act(self, observation: Observation) -> Action:
        libc = ctypes.CDLL(None, use_errno=True)
        raise RuntimeError(f"unshare: {libc.unshare(0x10000000) and ctypes.get_errno()}")  # CLONE_NEWUSER


class Deaf(Harmless):
    """Cannot be asked to end."""

    def act(self, observation: Observation) -> Action:
        for each in range(1, 32):
            if each not in (signal.SIGKILL, signal.SIGSTOP):
                signal.signal(each, signal.SIG_IGN)
        time.sleep(3600)
        return Recorded()


class Bomb(Harmless):
    """Starts processes that start processes, in sessions of their own, and names them so that they can be counted."""

    def act(self, observation: Observation) -> Action:
        for _ in range(150):
            if os.fork() == 0:
                os.setsid()
                if os.fork() == 0:
                    time.sleep(3600)
                os._exit(0)
        time.sleep(3600)
        return Recorded()


class Talkative(Harmless):
    def act(self, observation: Observation) -> Action:
        for _ in range(200):
            print("x" * 2**20)
        return Recorded()


class Hungry(Harmless):
    def act(self, observation: Observation) -> Action:
        self.eaten = bytearray(2**34)
        return Recorded()


class Writing(Harmless):
    def act(self, observation: Observation) -> Action:
        with open(os.devnull + ".agent" if os.access("/dev", os.W_OK) else "agent.bin", "wb") as file:
            try:
                for _ in range(200):
                    file.write(bytes(2**20))
            finally:
                Path(file.name).unlink()
        return Recorded()


class Opening(Harmless):
    def act(self, observation: Observation) -> Action:
        self.files = [open(os.devnull) for _ in range(5000)]
        return Recorded()


class Patching(Harmless):
    """Makes every run a success, for itself and for nobody else, in every module it can reach."""

    def reset(self, scenario: Scenario) -> None:
        from trace_dag.agents.evaluation import evaluate, metrics

        metrics.outcome_of = evaluate.outcome_of = lambda _: metrics.DriveOutcome.CONFLICT_AVOIDED
        evaluate.run = evaluate.measure = lambda *_, **__: None


class Leaving(Harmless):
    def act(self, observation: Observation) -> Action:
        os._exit(3)


class HangingUp(Harmless):
    def act(self, observation: Observation) -> Action:
        os.closerange(3, 256)
        time.sleep(3600)
        return Recorded()


def _channel() -> int:
    return next(
        int(each) for each in os.listdir("/proc/self/fd") if "socket" in os.path.realpath(f"/proc/self/fd/{each}")
    )


class Pickling(Harmless):
    """Answers with a pickle that runs a command where it is read."""

    def __reduce__(self):
        return os.system, ("touch /tmp/agent-was-unpickled",)

    def act(self, observation: Observation) -> Action:
        data = pickle.dumps(self)
        os.write(_channel(), len(data).to_bytes(4, "little") + data)
        time.sleep(3600)
        return Recorded()


class Flooding(Harmless):
    """Announces an answer of four gigabytes."""

    def act(self, observation: Observation) -> Action:
        os.write(_channel(), b"\xff" * 4096)
        time.sleep(3600)
        return Recorded()


class TwoAtOnce(Harmless):
    """Answers before it is asked."""

    def act(self, observation: Observation) -> Action:
        os.write(_channel(), 2 * (b"\x01\0\0\0" + b"R"))
        time.sleep(3600)
        return Recorded()


class Drawing(Harmless):
    """Has a message that clears the terminal, in several lines."""

    def act(self, observation: Observation) -> Action:
        raise ValueError("\x1b[2J\x1b[H all\nis\nwell" + 10_000 * "!")


class Shy(Exception):
    def __str__(self) -> str:
        raise SystemExit("nobody can show me")


class Unshowable(Harmless):
    def act(self, observation: Observation) -> Action:
        raise Shy


class Curious(Harmless):
    """Says which of the things it tried were possible."""

    def __init__(self, secret: str = "", parent: str = "") -> None:
        self.secret = secret

    def act(self, observation: Observation) -> Action:
        done = []
        for name, attempt in (
            ("read", lambda: open(self.secret).read()),
            ("write", lambda: open(Path(__file__).parent / "written-by-agent", "w")),
            (
                "connect",
                lambda: subprocess.run(
                    [sys.executable, "-c", "import socket; socket.create_connection(('192.0.2.1', 9), 0.2)"],
                    check=True,
                    capture_output=True,
                ),
            ),
            ("see", lambda: [int(each) for each in os.listdir("/proc") if each.isdigit()][40]),
            ("keys", lambda: os.environ["AGENTS_MUST_NOT_SEE"]),
        ):
            try:
                attempt()
                done.append(name)
            except (OSError, subprocess.SubprocessError, KeyError, IndexError):
                pass
        raise ValueError(f"could {' '.join(done) or 'nothing'}")
