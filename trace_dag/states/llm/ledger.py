"""What a run has spent and how fast it asks, over all processes that share the ledger's file.

The file holds the sum and the time of the next free slot, under a lock. Without a file the ledger is this
process's own.
"""

from __future__ import annotations

import fcntl
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from trace_dag.errors import Failure


@dataclass
class Ledger:
    """Budget (US dollars, None has no limit) and rate of one run. ``sleep`` and ``clock`` (epoch seconds) for tests."""

    budget_usd: float | None = None
    requests_per_minute: float = 60.0
    path: Path | None = None
    sleep: Callable[[float], None] = time.sleep
    clock: Callable[[], float] = time.time
    _spent_usd: float = 0.0
    _next_s: float = 0.0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def spent_usd(self) -> float:
        """What has been spent so far."""
        with self._held():
            return self._spent_usd

    def reserve(self) -> None:
        """Wait for this request's turn. Raises :class:`Failure` once the budget is spent."""
        with self._held():
            if self.budget_usd is not None and self._spent_usd >= self.budget_usd:
                raise Failure(
                    f"the budget of {self.budget_usd:g} USD for language models is spent "
                    f"({self._spent_usd:.4f} USD); raise states.llm_budget_usd and run the failed crashes again"
                )
            now = self.clock()
            slot = max(now, self._next_s)
            self._next_s = slot + 60.0 / self.requests_per_minute
        if slot > now:
            self.sleep(slot - now)

    def charge(self, cost_usd: float) -> None:
        """Book what a request cost."""
        with self._held():
            self._spent_usd += cost_usd

    @contextmanager
    def _held(self) -> Iterator[None]:
        """The ledger's state, read, and written back if changed, under a lock over threads and processes."""
        with self._lock:
            if self.path is None:
                yield
                return
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a+", encoding="utf-8") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                file.seek(0)
                text = file.read()
                if text:
                    state = json.loads(text)
                    self._spent_usd, self._next_s = float(state["spent_usd"]), float(state["next_s"])
                before = (self._spent_usd, self._next_s)
                try:
                    yield
                finally:
                    if (self._spent_usd, self._next_s) != before:
                        file.seek(0)
                        file.truncate()
                        json.dump({"spent_usd": self._spent_usd, "next_s": self._next_s}, file)
                        file.flush()
