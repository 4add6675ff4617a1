"""Executors of chunks of work: this process, a pool of processes, a Dask cluster.

The work is the same function for all of them, called with one picklable task. A task whose worker died is not lost: it
is split as far as possible and each part is tried alone, so that a crash that kills its worker is found and the others
are done. Does not belong here: the work itself.
"""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol, TypeVar

from trace_dag.common.errors import UserError
from trace_dag.common.settings import ExecutionSettings
from trace_dag.flow.pool import Lost, Pool, Task

T = TypeVar("T")
R = TypeVar("R")

_ATTEMPTS_ALONE = 2
_LOOK_S = 1.0  # how often a cluster is asked whether it has workers
_MOST_WITHOUT_WORKERS_S = 300.0  # a cluster that restarts its workers has some again by then


class Executor(Protocol):
    """Runs a function over tasks and yields each with its result as they come, in any order.

    ``machines`` is the number of machines with workers, by which limits per machine, such as the request rate of a
    public service, are divided.
    """

    workers: int
    machines: int

    def prepare(self, function: Callable[[], object]) -> None:
        """Start the workers early, each calling ``function``, if starting takes time; return without waiting."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R | Lost]]:
        """Return all tasks, each answered once.

        Exceptions of the function itself are raised.
        """

    def close(self) -> None:
        """Release the workers; it is safe to call this twice."""


def make_executor(settings: ExecutionSettings) -> Executor:
    """Return the executor the settings ask for."""
    if settings.executor == "dask":
        return DaskExecutor(settings.dask_address)
    workers = settings.workers or available_cores()
    if settings.executor == "in_process" or workers == 1:
        return InProcessExecutor()
    return ProcessExecutor(workers)


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_redoing_lost(
    executor: Executor, function: Callable[[T], R], tasks: Sequence[T], split: Callable[[T], Sequence[T]]
) -> Iterator[tuple[T, R | Lost]]:
    """Run all tasks; if a worker dies, split its task by ``split`` and run each part alone, at most twice."""
    lost: list[T] = []
    for task, found in executor.run(function, tasks):
        if isinstance(found, Lost):
            lost.append(task)
        else:
            yield task, found
    for task in lost:
        for part in split(task):
            for _ in range(_ATTEMPTS_ALONE):
                ((_, result),) = executor.run(function, [part])
                if not isinstance(result, Lost):
                    break
            yield part, result


class InProcessExecutor:
    """Runs one task after the other in this process."""

    workers = 1
    machines = 1

    def prepare(self, function: Callable[[], object]) -> None:
        """Start nothing."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R | Lost]]:
        for task in tasks:
            yield task, function(task)

    def close(self) -> None:
        """Release nothing."""


@dataclass(frozen=True)
class _Call:
    """A function to call with a task."""

    function: Callable[[Any], Any]
    task: Any


@dataclass(frozen=True)
class _Raised:
    """An exception of a function, for the caller."""

    error: Exception


class _Calls:
    """Calls of functions by the workers of a pool."""

    def prepare(self, name: str) -> None:
        """Share nothing between calls."""

    def do(self, shared: None, call: _Call) -> Any:
        """Return one call."""
        try:
            return call.function(call.task)
        except Exception as error:
            return _Raised(error)


def _called(function: Callable[[], object]) -> None:
    function()


class ProcessExecutor:
    """A pool of spawned processes, each with one task at a time."""

    machines = 1

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: Pool[None, _Call, Any] = Pool(_Calls(), workers=workers)

    def prepare(self, function: Callable[[], object]) -> None:
        self._pool.start(_Call(_called, function))

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R | Lost]]:
        for answer in self._pool.run([Task("", (_Call(function, task),)) for task in tasks]):
            result: Any = answer.result
            if isinstance(result, _Raised):
                raise result.error
            yield answer.step.task, result

    def processes(self) -> list[SpawnProcess]:
        """Return the present worker processes."""
        return self._pool.processes()

    def close(self) -> None:
        """End the worker processes."""
        self._pool.close()


class DaskExecutor:
    """The workers of a running Dask scheduler, which need nothing but this package and the storage root.

    A cluster may lose all its workers and get new ones. Without workers for :attr:`most_without_workers_s`, the run
    ends with :class:`trace_dag.common.errors.UserError`; finished results are stored.
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
        """Start nothing: the workers run already."""

    def run(self, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R | Lost]]:
        """See :class:`Executor`. Dask itself gives a dead worker's task to another, a few times."""
        under_way = {self._client.submit(function, task, pure=False): task for task in tasks}
        while under_way:
            for future in self._wait_for_some(list(under_way)):
                yield under_way.pop(future), self._result(future)
                future.release()

    def _wait_for_some(self, futures: list[Any]) -> set[Any]:
        """Return the futures that are done, at least one of them."""
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
            return Lost(str(error))
