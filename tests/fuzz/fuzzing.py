"""A target, many damaged inputs: nothing but what it may raise, and in long runs nothing that takes too long."""

from __future__ import annotations

import multiprocessing
import random
import signal
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

from hypothesis import HealthCheck, given, seed, settings

from tests.fuzz.damage import damaged, damaged_at_random
from tests.fuzz.targets import Target, with_right_checksums

_OF_ONE_PROCESS = 500
_FORK = multiprocessing.get_context("fork")  # what a target holds need not be picklable


class TookTooLongError(Exception):
    """An input over its time limit."""


def fuzz_briefly(target: Target, inputs: int, folder: Path) -> Counter[str]:
    """What came of so many inputs. Raises what the target must not raise, for the least input that shows it."""
    found: Counter[str] = Counter()

    @seed(1)
    @settings(max_examples=inputs, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(damaged(target.seeds))
    def one(data: bytes) -> None:
        found[_tried(target, data, folder)] += 1

    one()
    return found


@dataclass
class LongRun:
    """What came of many inputs by name, the most CPU time that one took (s), an input for each fault by what it was."""

    found: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    faults: dict[str, bytes] = field(default_factory=dict)
    cpu_s: float = 0.0

    def add(self, other: LongRun) -> None:
        """What came of others besides."""
        self.found += other.found
        self.slowest_s = max(self.slowest_s, other.slowest_s)
        self.faults = other.faults | self.faults
        self.cpu_s += other.cpu_s


def fuzz_long(target: Target, inputs: int, folder: Path, *, beginning: int, until_s: float) -> LongRun:
    """So many inputs at random, or as many as there is time for (``time.monotonic()``).

    A process has only some hundred of them: libosmium keeps an open file of each ``.osm.pbf`` that breaks off. An input
    that ends its process is a fault, too.
    """
    run = LongRun()
    for first in range(0, inputs, _OF_ONE_PROCESS):
        if time.monotonic() > until_s:
            break
        rng = random.Random(f"{beginning} {first}")
        run.add(_in_a_process(target, min(_OF_ONE_PROCESS, inputs - first), folder, rng, until_s))
    return run


def _in_a_process(target: Target, inputs: int, folder: Path, rng: random.Random, until_s: float) -> LongRun:
    ours, theirs = _FORK.Pipe(duplex=False)
    last, place = folder / "last", folder / "place"
    place.mkdir(exist_ok=True)
    child = _FORK.Process(target=lambda: theirs.send(_one_after_the_other(target, inputs, place, last, rng, until_s)))
    child.start()
    theirs.close()
    try:
        return ours.recv()
    except EOFError:
        data = last.read_bytes()
        return LongRun(Counter(FAULT=1), 0.0, {f"the process ended (input of {len(data)} bytes)": data})
    finally:
        child.join()


def _one_after_the_other(
    target: Target, inputs: int, place: Path, last: Path, rng: random.Random, until_s: float
) -> LongRun:
    run = LongRun()
    for _ in range(inputs):
        if time.monotonic() > until_s:
            break
        began = time.process_time()
        data = damaged_at_random(target.seeds, rng)
        last.write_bytes(data)
        try:
            with _at_most(target.most_s):
                run.found[_tried(target, data, place)] += 1
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            run.found["FAULT"] += 1
            run.faults.setdefault(
                f"{type(error).__name__} in {frame.filename}:{frame.lineno}: {str(error)[:200]}", data
            )
        run.slowest_s = max(run.slowest_s, time.process_time() - began)
    run.cpu_s = time.process_time()
    return run


def _tried(target: Target, data: bytes, folder: Path) -> str:
    for left in folder.iterdir():
        left.unlink()
    try:
        target.read(with_right_checksums(data) if data[:2] == b"PK" else data, folder)
    except target.raises as error:
        if not str(error):
            raise AssertionError("said nothing") from error
        return type(error).__name__
    return "read"


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """So much CPU time, which a busy machine does not use up; and twenty times as much by the clock, for what waits."""

    def ring(_: int, __: FrameType | None) -> None:
        raise TookTooLongError(f"took longer than {seconds:g} s")

    alarms = ((signal.SIGPROF, signal.ITIMER_PROF, seconds), (signal.SIGALRM, signal.ITIMER_REAL, 20 * seconds))
    before = [(number, signal.signal(number, ring)) for number, _, _ in alarms]
    for _, timer, limit_s in alarms:
        signal.setitimer(timer, limit_s)
    try:
        yield
    finally:
        for _, timer, _ in alarms:
            signal.setitimer(timer, 0)
        for number, handler in before:
            signal.signal(number, handler)
