"""An object store and a Dask cluster on loopback, every part a process of its own that a test may kill."""

from __future__ import annotations

import os
import subprocess
import sys
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.loopback import free_port
from tests.waiting import eventually
from trace_dag.common.storage.files import Storage

BUCKET = "crashes"


@contextmanager
def object_store(delay_s: float = 0.0) -> Iterator[dict[str, str]]:
    """An S3-compatible server with an empty bucket; the environment in which it is found.

    Each of its answers waits for ``delay_s`` (:mod:`tests.faults.slow_relay`).
    """
    pytest.importorskip("moto")
    pytest.importorskip("s3fs")
    address = f"http://127.0.0.1:{free_port()}"
    seen_at = f"http://127.0.0.1:{free_port()}" if delay_s else address
    environment = {
        "AWS_ENDPOINT_URL": seen_at,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    port, seen_port = (each.rpartition(":")[2] for each in (address, seen_at))
    processes = [_start([sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", port], {})]
    try:
        _wait_for(address, processes[0])
        if delay_s:
            relay = [sys.executable, "-m", "tests.faults.slow_relay", seen_port, port, str(delay_s)]
            processes.append(_start(relay, {}))
            _wait_for(seen_at, processes[1])
        request = urllib.request.Request(f"{address}/{BUCKET}", method="PUT")
        urllib.request.urlopen(request).close()
        yield environment
    finally:
        for process in processes:
            _end(process)


class DaskCluster:
    """A scheduler and workers of one thread each. ``environment`` is that of the workers."""

    def __init__(self, folder: Path, workers: int, environment: Mapping[str, str]) -> None:
        self.address = f"tcp://127.0.0.1:{free_port()}"
        port = self.address.rpartition(":")[2]
        scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
        worker = ["distributed.cli.dask_worker", self.address, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
        worker += ["--local-directory", str(folder)]
        self._environment, self._commands = environment, (scheduler, *[worker] * workers)
        self.start()

    def start(self) -> None:
        """Start the scheduler and its workers."""
        self.scheduler, *self.workers = (
            _start([sys.executable, "-m", *command], self._environment) for command in self._commands
        )

    def wait_for_workers(self, workers: int) -> None:
        """Wait until so many workers have come."""
        distributed = pytest.importorskip("distributed")
        with distributed.Client(self.address, timeout="300s", set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=300)

    def settings(self) -> dict[str, str]:
        """The environment that sends a run's work here."""
        return {"TRACE_DAG_EXECUTION__EXECUTOR": "dask", "TRACE_DAG_EXECUTION__DASK_ADDRESS": self.address}

    def close(self) -> None:
        """End all processes that still live."""
        for process in (*self.workers, self.scheduler):
            _end(process)


@contextmanager
def dask_cluster(folder: Path, workers: int, environment: Mapping[str, str]) -> Iterator[DaskCluster]:
    """A cluster that is gone afterwards."""
    pytest.importorskip("distributed")
    cluster = DaskCluster(folder, workers, environment)
    try:
        yield cluster
    finally:
        cluster.close()


def kill_when_under_way(cluster: DaskCluster, run: subprocess.Popen[str], storage: Storage) -> None:
    """Kill one worker once maps have been made."""
    wait_until_under_way(run, storage)
    cluster.workers[0].kill()


def lose_scheduler_when_under_way(cluster: DaskCluster, run: subprocess.Popen[str], storage: Storage) -> None:
    """Kill the scheduler once maps have been made, and its workers, which end without it; start them all again."""
    wait_until_under_way(run, storage)
    cluster.close()
    cluster.start()


def wait_until_under_way(run: subprocess.Popen[str], storage: Storage) -> None:
    """Wait for the first maps of a run."""

    def under_way() -> bool:
        assert run.poll() is None, run.communicate()[0]
        return len(storage.list("road_map")) >= 2

    eventually(under_way, "the run never got going")


def _start(command: list[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command, env=os.environ | environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()


def _wait_for(address: str, server: subprocess.Popen[bytes]) -> None:
    def answers() -> bool:
        try:
            urllib.request.urlopen(address, timeout=5).close()
        except OSError:
            assert server.poll() is None, "the server ended"
            return False
        return True

    eventually(answers, "the server never answered")
