"""Where chunks of work run: in this process, in a pool of processes, on a Dask cluster.

The work is the same function for all of them, called with one picklable task. A task whose worker died is not lost:
it is split as far as it can be and each part is tried alone, so that the one crash that kills its worker is found and
the others are done. Does not belong here: what the work is.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.connection
import multiprocessing.process
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Generic, Protocol, TypeVar

from trace_dag.errors import UserError
from trace_dag.logs import configure_logging
from trace_dag.processes import is_stopped
from trace_dag.settings import ExecutionSettings

T = TypeVar("T")
R = TypeVar("R")

_ATTEMPTS_ALONE = 2
_LOOK_S = 1.0  # how often a pool looks after its workers
_MOST_STOPPED_S = 10.0  # after which a worker that was stopped (SIGSTOP) counts as lost
_MOST_WITHOUT_WORKERS_S = 300.0  # a cluster that restarts its workers has some again by then


@dataclass(frozen=True)
class WorkerLost:
    """The answer for a task whose worker died every time; ``detail`` says how."""

    detail: str


@dataclass(frozen=True)
class Answer(Generic[T, R]):
    """A task and what came of it."""

    task: T
    result: R | WorkerLost


class Executor(Protocol):
    """Runs a function over tasks and yields the answers as they come, in any order.

    ``machines`` counts those the workers are on: what all processes of one machine share, such as the rate at which a
    public service is asked, has to be divided by it.
    """

    workers: int
    machines: int

    def prepare(self, function: Callable[[], object]) -> None:
        """Let the workers start now, each calling ``function``, if starting them takes time; waits for nothing."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[Answer[T, R]]:
        """All tasks, each answered once. Exceptions of the function itself are raised."""

    def alone(self, function: Callable[[T], R], task: T) -> R | WorkerLost:
        """One task with no other running in the same worker process."""

    def close(self) -> None:
        """Release the workers; safe to call twice."""


def make_executor(settings: ExecutionSettings) -> Executor:
    """The executor the settings ask for."""
    if settings.executor == "dask":
        return DaskExecutor(settings.dask_address)
    workers = settings.workers or available_cores()
    if settings.executor == "in_process" or workers == 1:
        return InProcessExecutor()
    return ProcessExecutor(workers)


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_redoing_lost(
    executor: Executor, function: Callable[[T], R], tasks: Sequence[T], split: Callable[[T], Sequence[T]]
) -> Iterator[Answer[T, R]]:
    """Run all tasks; one whose worker died is split by ``split`` and its parts are run alone, each at most twice."""
    lost: list[T] = []
    for answer in executor.run(function, tasks):
        if isinstance(answer.result, WorkerLost):
            lost.append(answer.task)
        else:
            yield answer
    for task in lost:
        for part in split(task):
            result: R | WorkerLost = WorkerLost("not tried")
            for _ in range(_ATTEMPTS_ALONE):
                result = executor.alone(function, part)
                if not isinstance(result, WorkerLost):
                    break
            yield Answer(part, result)


class InProcessExecutor:
    """Runs one task after the other in this process."""

    workers = 1
    machines = 1

    def prepare(self, function: Callable[[], object]) -> None:
        """There is nothing to start."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[Answer[T, R]]:
        """See :class:`Executor`."""
        for task in tasks:
            yield Answer(task, function(task))

    def alone(self, function: Callable[[T], R], task: T) -> R | WorkerLost:
        """See :class:`Executor`."""
        return function(task)

    def close(self) -> None:
        """Nothing to release."""


class ProcessExecutor:
    """A pool of spawned processes (never forked: MuJoCo, Arrow and Dagster hold threads)."""

    machines = 1
    most_stopped_s = _MOST_STOPPED_S

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._stopped: dict[multiprocessing.process.BaseProcess, float] = {}  # since when, of the monotonic clock
        self._pool: ProcessPoolExecutor | None = None
        self._lifeline: Connection | None = None

    def prepare(self, function: Callable[[], object]) -> None:
        """See :class:`Executor`."""
        for _ in range(self.workers):
            self._ready_pool().submit(function)

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[Answer[T, R]]:
        """See :class:`Executor`. At most two tasks per worker are under way, so few are lost with a worker."""
        try:
            yield from self._run(function, tasks)
        except BaseException:  # interrupted: nobody waits for what is under way any more
            self._drop_pool(at_once=True)
            raise

    def _run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[Answer[T, R]]:
        waiting = list(reversed(tasks))
        under_way: dict[Future[R], T] = {}
        while waiting or under_way:
            while waiting and len(under_way) < 2 * self.workers:
                task = waiting.pop()
                try:
                    under_way[self._ready_pool().submit(function, task)] = task
                except BrokenProcessPool:  # died between two answers; what is under way will say so
                    waiting.append(task)
                    if not under_way:
                        self._drop_pool()
                    break
            done, _ = wait(under_way, _LOOK_S, return_when=FIRST_COMPLETED) if under_way else (set(), None)
            if not done:
                self._end_stopped()
            broken = False
            for future in done:
                task = under_way.pop(future)
                try:
                    yield Answer(task, future.result())
                except BrokenProcessPool as error:
                    broken = True
                    yield Answer(task, WorkerLost(str(error)))
            if broken:
                for task in under_way.values():
                    yield Answer(task, WorkerLost("its worker died together with another"))
                under_way.clear()
                self._drop_pool()

    def alone(self, function: Callable[[T], R], task: T) -> R | WorkerLost:
        """See :class:`Executor`: in a pool of one process made for it."""
        single = ProcessExecutor(1)
        try:
            (answer,) = single.run(function, [task])
        finally:
            single.close()
        return answer.result

    def close(self) -> None:
        """End the worker processes."""
        self._drop_pool()

    def _ready_pool(self) -> ProcessPoolExecutor:
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            theirs, self._lifeline = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(
                self.workers, mp_context=context, initializer=_prepare_worker, initargs=(theirs,)
            )
        return self._pool

    def processes(self) -> list[multiprocessing.process.BaseProcess]:
        """The worker processes there are."""
        return list((self._pool._processes or {}).values()) if self._pool is not None else []

    def _end_stopped(self) -> None:
        """Kill workers that somebody stopped (SIGSTOP) some time ago: their tasks would never be finished."""
        stopped = [each for each in self.processes() if each.pid is not None and is_stopped(each.pid)]
        since = {worker: self._stopped.get(worker, time.monotonic()) for worker in stopped}
        self._stopped = since
        for worker, first_seen_s in since.items():
            if time.monotonic() - first_seen_s >= self.most_stopped_s:
                worker.kill()

    def _drop_pool(self, *, at_once: bool = False) -> None:
        """End the workers when their present tasks are done, or ``at_once``."""
        if self._pool is None or self._lifeline is None:
            return
        if at_once:
            for worker in self.processes():  # one that was stopped would not notice that nobody wants it any more
                worker.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._lifeline.close()
        self._pool = self._lifeline = None


def _prepare_worker(lifeline: Connection) -> None:
    # One thread per process: the processes are the parallelism.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    configure_logging()
    # Ctrl-C is the parent's to handle; it ends its workers in good order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    # Its other end closes when the parent wants no more of this worker, and when the parent is killed: a worker of a
    # killed parent would wait for its next task for ever.
    multiprocessing.connection.wait([lifeline])
    os._exit(1)


class DaskExecutor:
    """The workers of a running Dask scheduler, which need nothing but this package and the storage root.

    A cluster may lose all its workers and get new ones. If it has none for :attr:`most_without_workers_s`, the run ends
    with :class:`trace_dag.errors.UserError`; what was finished by then is stored.
    """

    most_without_workers_s = _MOST_WITHOUT_WORKERS_S

    def __init__(self, address: str | None) -> None:
        if not address:
            raise UserError("executor dask: set execution.dask_address to the address of a running scheduler")
        try:
            distributed: Any = importlib.import_module("distributed")
        except ImportError as error:
            raise UserError("executor dask: install trace-dag[dask]") from error
        try:
            self._client = distributed.Client(address, timeout="10s", set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise UserError(f"executor dask: no scheduler answers at {address} ({error})") from error
        self.workers = max(1, sum(self._client.nthreads().values()))
        hosts = {worker["host"] for worker in self._client.scheduler_info(n_workers=-1)["workers"].values()}
        self.machines = max(1, len(hosts))

    def prepare(self, function: Callable[[], object]) -> None:
        """The workers run already."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[Answer[T, R]]:
        """See :class:`Executor`. Dask itself gives a dead worker's task to another, a few times."""
        under_way = {self._client.submit(function, task, pure=False): task for task in tasks}
        while under_way:
            for future in self._wait_for_some(list(under_way)):
                yield Answer(under_way.pop(future), self._result(future))
                future.release()

    def alone(self, function: Callable[[T], R], task: T) -> R | WorkerLost:
        """See :class:`Executor`."""
        future = self._client.submit(function, task, pure=False)
        self._wait_for_some([future])
        result: R | WorkerLost = self._result(future)
        return result

    def _wait_for_some(self, futures: list[Any]) -> set[Any]:
        """The futures that are done, at least one of them."""
        wait_for = importlib.import_module("distributed").wait
        since_s: float | None = None  # when the cluster was first seen without workers, of the monotonic clock
        while True:
            try:
                with self._client.as_current():
                    done: set[Any] = wait_for(futures, timeout=_LOOK_S, return_when="FIRST_COMPLETED").done
                return done
            except CancelledError:  # the scheduler was lost with its tasks
                return {future for future in futures if future.done()}
            except TimeoutError:
                since_s = None if self._has_workers() else since_s or time.monotonic()
                if since_s is not None and time.monotonic() - since_s > self.most_without_workers_s:
                    raise UserError(
                        f"executor dask: the scheduler at {self._client.scheduler.address} has had no workers for "
                        f"{self.most_without_workers_s:.0f} s; start workers, then run again: what was finished is kept"
                    ) from None

    def _has_workers(self) -> bool:
        try:
            return bool(self._client.nthreads())
        except OSError:  # the scheduler does not answer
            return False

    def close(self) -> None:
        """Leave the cluster as it is."""
        self._client.close()

    @staticmethod
    def _result(future: Any) -> Any:
        killed_worker = importlib.import_module("distributed.scheduler").KilledWorker
        try:
            return future.result()
        except (killed_worker, CancelledError) as error:
            return WorkerLost(str(error))
