"""Work that may never end: tasks in worker processes of their own, each step of them with a deadline that is kept.

For other people's code (agents under test): if it loops for ever, uses up the memory or ends its process, only its own
step is lost. A task is a sequence of steps. Its worker answers after each one, so a worker that is killed loses the
step it was in, and a new worker does the rest. Our own work runs in :mod:`trace_dag.flow.executors`.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Generic, Protocol, TypeVar

from trace_dag.errors import Failure
from trace_dag.processes import end_all, how_it_ended

C = TypeVar("C")  # what the steps of a task share
S = TypeVar("S")  # one step
R = TypeVar("R")  # its result
S_in = TypeVar("S_in", contravariant=True)
R_out = TypeVar("R_out", covariant=True)

_START_S = 120.0  # for a worker to come up and for what a task's steps share to be made
_LONGEST_WAIT_S = 0.5
_CONTEXT = multiprocessing.get_context("spawn")  # never forked: MuJoCo and Arrow hold threads


@dataclass(frozen=True)
class Task(Generic[S]):
    """Steps that one worker does one after the other, with what they share made once from ``name``."""

    name: str
    steps: tuple[S, ...]


@dataclass(frozen=True)
class StepLost:
    """The answer for a step that was not finished; ``detail`` says why."""

    detail: str


@dataclass(frozen=True)
class StepAnswer(Generic[S, R]):
    """A step of a task and what came of it."""

    task: str
    step: S
    result: R | StepLost | Failure


class StepWork(Protocol[C, S_in, R_out]):
    """What the workers do; picklable."""

    def prepare(self, name: str) -> C:
        """What the steps of a task share."""

    def do(self, shared: C, step: S_in) -> R_out:
        """One step."""


@dataclass(eq=False)
class _Worker(Generic[S]):
    process: SpawnProcess
    connection: Connection
    task: Task[S] | None = None
    done: int = 0
    prepared: bool = False
    deadline_s: float = 0.0


@dataclass(frozen=True)
class _Ready:
    """What the steps share has been made."""


class DeadlinePool(Generic[C, S, R]):
    """Worker processes for one kind of work.

    ``step_limit_s``: wall-clock time a step may take. ``memory_mb``: address space of a worker beyond what it starts
    with. A :class:`Failure` of ``prepare`` answers every step of its task.
    """

    def __init__(self, work: StepWork[C, S, R], *, workers: int, step_limit_s: float, memory_mb: int) -> None:
        self._work = work
        self._count = workers
        self._step_limit_s = step_limit_s
        self._memory_mb = memory_mb

    def run(self, tasks: Sequence[Task[S]]) -> Iterator[StepAnswer[S, R]]:
        """Every step answered once, in order within its task."""
        waiting = deque(task for task in tasks if task.steps)
        workers = [self._start() for _ in range(min(self._count, len(waiting)))]
        try:
            while waiting or any(worker.task for worker in workers):
                for worker in workers:
                    if worker.task is None and waiting:
                        self._give(worker, waiting.popleft())
                busy = {worker.connection: worker for worker in workers if worker.task}
                until_s = min(worker.deadline_s for worker in busy.values()) - time.monotonic()
                for connection in wait(list(busy), timeout=min(max(until_s, 0.0), _LONGEST_WAIT_S)):
                    if isinstance(connection, Connection):
                        yield from self._heard(busy[connection], workers, waiting)
                for worker in list(busy.values()):
                    if worker in workers and worker.task and time.monotonic() > worker.deadline_s:
                        yield self._lost(worker, workers, waiting, f"took longer than {self._step_limit_s:g} s")
        finally:
            for worker in workers:
                _end(worker)

    def _start(self) -> _Worker[S]:
        ours, theirs = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=_serve, args=(theirs, self._work, self._memory_mb), daemon=True)
        process.start()
        theirs.close()
        return _Worker(process, ours)

    def _give(self, worker: _Worker[S], task: Task[S]) -> None:
        worker.task, worker.done, worker.prepared = task, 0, False
        worker.deadline_s = time.monotonic() + _START_S
        with suppress(BrokenPipeError):  # it died meanwhile: listening to it will say so
            worker.connection.send(task)

    def _heard(
        self, worker: _Worker[S], workers: list[_Worker[S]], waiting: deque[Task[S]]
    ) -> Iterator[StepAnswer[S, R]]:
        task = worker.task
        if task is None:
            return
        try:
            message = worker.connection.recv()
        except (EOFError, OSError):
            worker.process.join(timeout=5.0)
            yield self._lost(worker, workers, waiting, f"ended its process ({how_it_ended(worker.process.exitcode)})")
            return
        worker.deadline_s = time.monotonic() + self._step_limit_s
        if isinstance(message, _Ready):
            worker.prepared = True
        elif isinstance(message, Failure):
            worker.task = None
            for step in task.steps:
                yield StepAnswer(task.name, step, message)
        else:
            step = task.steps[worker.done]
            worker.done += 1
            if worker.done == len(task.steps):
                worker.task = None
            yield StepAnswer(task.name, step, message)

    def _lost(
        self, worker: _Worker[S], workers: list[_Worker[S]], waiting: deque[Task[S]], detail: str
    ) -> StepAnswer[S, R]:
        """The step a worker was in is lost; the rest of its task goes to a new worker."""
        task = worker.task
        if task is None or not worker.prepared:
            raise Failure(f"a worker {detail} before its first step ({task.name if task else 'idle'})")
        _end(worker)
        workers[workers.index(worker)] = self._start()
        step, rest = task.steps[worker.done], task.steps[worker.done + 1 :]
        if rest:
            waiting.appendleft(Task(task.name, rest))
        return StepAnswer(task.name, step, StepLost(detail))


def _end(worker: _Worker[S]) -> None:
    worker.connection.close()
    if worker.process.pid is not None:
        end_all(worker.process.pid)
    worker.process.join()


def _serve(connection: Connection, work: StepWork[C, S, R], memory_mb: int) -> None:
    """A worker's life: tasks in, an answer after each step out, until the parent hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.stdout = sys.stderr  # what an agent prints is not the command's answer
    limited = False
    while True:
        try:
            task: Task[S] = connection.recv()
        except EOFError:
            return
        try:
            shared = work.prepare(task.name)
        except Failure as failure:
            connection.send(failure)
            continue
        if not limited:  # once what we need ourselves is loaded
            _limit_memory(memory_mb)
            limited = True
        connection.send(_Ready())
        for step in task.steps:
            connection.send(work.do(shared, step))


def _limit_memory(memory_mb: int) -> None:
    with suppress(OSError, ValueError):  # not everywhere: no limit is better than no work
        pages = int(open("/proc/self/statm").read().split()[0])  # noqa: SIM115, PTH123 - a line of a pseudo-file
        limit = pages * resource.getpagesize() + memory_mb * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
