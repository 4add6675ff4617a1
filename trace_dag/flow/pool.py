"""Worker processes, each with one task at a time, that may be killed without harm to the others' work.

A task is a sequence of steps. Its worker answers after each one, so if a worker dies, is stopped or exceeds its time,
only the current step is lost, and a new worker does the rest. The project's own work runs here
(:mod:`trace_dag.flow.executors`), and foreign code (agents under test), with limits of time and memory.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import resource
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Generic, Protocol, TypeVar

from trace_dag.common.errors import Failure
from trace_dag.common.messages.logs import configure_logging
from trace_dag.common.processes import end_all, how_it_ended, is_stopped

C = TypeVar("C")  # what the steps of a task share
S = TypeVar("S")  # one step
R = TypeVar("R")  # its result
S_in = TypeVar("S_in", contravariant=True)
R_out = TypeVar("R_out", covariant=True)

_START_S = 120.0  # for a worker to come up and for what a task's steps share to be made, where steps have a limit
_LOOK_S = 0.5  # how often a pool looks after its workers
_CONTEXT = multiprocessing.get_context("spawn")  # never forked: MuJoCo, Arrow and Dagster hold threads


@dataclass(frozen=True)
class Task(Generic[S]):
    """Steps that one worker does one by one; their shared state is made once from ``name``."""

    name: str
    steps: tuple[S, ...]


@dataclass(frozen=True)
class Lost:
    """The answer for unfinished work; ``detail`` is the reason."""

    detail: str


@dataclass(frozen=True)
class StepAnswer(Generic[S, R]):
    """A step of a task and its result."""

    task: str
    step: S
    result: R | Lost | Failure


class StepWork(Protocol[C, S_in, R_out]):
    """The work of the workers; picklable."""

    def prepare(self, name: str) -> C:
        """Prepare the shared state of a task's steps."""

    def do(self, shared: C, step: S_in) -> R_out:
        """Return one step."""


@dataclass(eq=False)
class _Worker(Generic[S]):
    process: SpawnProcess
    connection: Connection
    lifeline: Connection
    task: Task[S] | None = None
    told: bool = True  # of what comes of its task
    done: int = 0
    deadline_s: float | None = None
    stopped_since_s: float | None = None


@dataclass(frozen=True)
class _Ready:
    """A worker's message that the shared state of the steps is ready."""


class Pool(Generic[C, S, R]):
    """Worker processes for one kind of work, started when they are needed and ended by :meth:`close`.

    ``step_limit_s``: wall-clock time a step may take. ``memory_mb``: address space of a worker beyond what it starts
    with. A :class:`Failure` of ``prepare`` answers every step of its task.
    """

    most_stopped_s = 10.0  # after which a worker that was stopped (SIGSTOP) counts as lost

    def __init__(
        self, work: StepWork[C, S, R], *, workers: int, step_limit_s: float | None = None, memory_mb: int | None = None
    ) -> None:
        self.workers = workers
        self._work = work
        self._step_limit_s = step_limit_s
        self._memory_mb = memory_mb
        self._running: list[_Worker[S]] = []

    def start(self, step: S) -> None:
        """Start all workers now, each with a step whose answer is ignored."""
        while len(self._running) < self.workers:
            self._give(self._started(), Task("", (step,)), told=False)

    def run(self, tasks: Sequence[Task[S]]) -> Iterator[StepAnswer[S, R]]:
        """Yield every step answered once, in order within its task."""
        waiting = deque(task for task in tasks if task.steps)
        try:
            while waiting or any(worker.task and worker.told for worker in self._running):
                self._give_out(waiting)
                busy = {worker.connection: worker for worker in self._running if worker.task}
                for connection in wait(list(busy), timeout=self._until_next_look_s()):
                    if isinstance(connection, Connection):
                        yield from self._heard(busy[connection], waiting)
                for worker in busy.values():
                    if worker in self._running and (why := self._too_long(worker)):
                        yield from self._lost(worker, waiting, why)
        except BaseException:  # interrupted: nobody waits for what is under way any more
            self.close()
            raise

    def close(self) -> None:
        """End the workers; it is safe to call this twice."""
        while self._running:
            self._end(self._running[-1])

    def processes(self) -> list[SpawnProcess]:
        """Return the present worker processes."""
        return [worker.process for worker in self._running]

    def _started(self) -> _Worker[S]:
        ours, theirs = _CONTEXT.Pipe()
        end, lifeline = _CONTEXT.Pipe(duplex=False)
        process = _CONTEXT.Process(target=_serve, args=(theirs, end, self._memory_mb), daemon=True)
        process.start()
        theirs.close()
        end.close()
        # Not among the arguments: there it would be waited for to be read, even by a process that has died.
        with suppress(ConnectionError):
            ours.send(self._work)
        self._running.append(_Worker(process, ours, lifeline))
        return self._running[-1]

    def _give_out(self, waiting: deque[Task[S]]) -> None:
        idle = [worker for worker in self._running if not worker.task]
        while waiting and (idle or len(self._running) < self.workers):
            self._give(idle.pop() if idle else self._started(), waiting.popleft())

    def _give(self, worker: _Worker[S], task: Task[S], *, told: bool = True) -> None:
        worker.task, worker.told, worker.done = task, told, 0
        worker.deadline_s = time.monotonic() + _START_S if self._step_limit_s is not None else None
        with suppress(ConnectionError):  # it died meanwhile: listening to it will say so
            worker.connection.send(task)

    def _until_next_look_s(self) -> float:
        deadlines = [worker.deadline_s for worker in self._running if worker.task and worker.deadline_s is not None]
        return min(_LOOK_S, max(0.0, min(deadlines, default=_LOOK_S + time.monotonic()) - time.monotonic()))

    def _too_long(self, worker: _Worker[S]) -> str:
        """Return the reason to give up a worker; "" if there is none."""
        now_s = time.monotonic()
        if worker.deadline_s is not None and now_s > worker.deadline_s:
            return f"took longer than {self._step_limit_s:g} s"
        if worker.process.pid is None or not is_stopped(worker.process.pid):
            worker.stopped_since_s = None
            return ""
        worker.stopped_since_s = worker.stopped_since_s or now_s
        return "its process was stopped" if now_s - worker.stopped_since_s >= self.most_stopped_s else ""

    def _heard(self, worker: _Worker[S], waiting: deque[Task[S]]) -> Iterator[StepAnswer[S, R]]:
        task = worker.task
        if task is None:
            return
        try:
            message = worker.connection.recv()
        except (EOFError, OSError):
            worker.process.join(timeout=5.0)
            ended = f"ended its process ({how_it_ended(worker.process.exitcode)})"
            yield from self._lost(worker, waiting, ended)
            return
        if self._step_limit_s is not None:
            worker.deadline_s = time.monotonic() + self._step_limit_s
        if isinstance(message, _Ready):
            return
        answered = task.steps if isinstance(message, Failure) else (task.steps[worker.done],)
        worker.done += len(answered)
        if worker.done >= len(task.steps):
            worker.task = None
        if worker.told:
            for step in answered:
                yield StepAnswer(task.name, step, message)

    def _lost(self, worker: _Worker[S], waiting: deque[Task[S]], detail: str) -> Iterator[StepAnswer[S, R]]:
        """Yield the lost step of a worker, and give the rest of its task to a new worker."""
        task, done, told = worker.task, worker.done, worker.told
        self._end(worker)
        if task is None or not told:
            return
        if rest := task.steps[done + 1 :]:
            waiting.appendleft(Task(task.name, rest))
        yield StepAnswer(task.name, task.steps[done], Lost(detail))

    def _end(self, worker: _Worker[S]) -> None:
        self._running.remove(worker)
        worker.connection.close()
        if worker.process.pid is not None:
            end_all(worker.process.pid)
        worker.process.join()
        worker.lifeline.close()


def _serve(connection: Connection, lifeline: Connection, memory_mb: int | None) -> None:
    """Run a worker: prepare its work, then answer each step of the received tasks until the parent closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle; it ends its workers in good order
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # the processes are the parallelism
    sys.stdout = sys.stderr  # what an agent prints is not the command's answer
    configure_logging()
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    limited = memory_mb is None
    work: StepWork[Any, Any, Any] | None = None
    while True:
        try:
            if work is None:
                work = connection.recv()
            task: Task[Any] = connection.recv()
        except EOFError:
            return
        try:
            shared = work.prepare(task.name)
        except Failure as failure:
            connection.send(failure)
            continue
        if not limited and memory_mb is not None:  # once what we need ourselves is loaded
            _limit_memory(memory_mb)
            limited = True
        connection.send(_Ready())
        for step in task.steps:
            connection.send(work.do(shared, step))


def _end_with(lifeline: Connection) -> None:
    # Its other end closes when the parent is killed: a worker in the middle of a task would go on without it.
    multiprocessing.connection.wait([lifeline])
    os._exit(1)


def _limit_memory(memory_mb: int) -> None:
    with suppress(OSError, ValueError):  # not everywhere: no limit is better than no work
        pages = int(open("/proc/self/statm").read().split()[0])  # noqa: SIM115, PTH123 - a line of a pseudo-file
        limit = pages * resource.getpagesize() + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
