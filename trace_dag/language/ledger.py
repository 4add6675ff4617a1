"""The ledger of a run: money spent, rate of questions, and whether the provider answers, over all its processes.

Each process has its own page, a file in a folder of the storage root. Only this process writes it and all read it, so
no lock is needed, and the workers of a cluster share budget and rate through the object store. Without files the ledger
counts this process alone.

The budget is checked before each request, so only requests that were under way when it was reached go beyond it. A
request's turn comes after every turn given so far and after those of processes that have waited longer. If two
processes look at the same moment, they can take the same turn. Clocks of machines are taken to agree to a second.
"""

from __future__ import annotations

import math
import threading
import time
import uuid
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import BudgetSpent, DamagedFile, TransientFailure
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage

FOLDER = "llm_ledgers"
MOST_UNANSWERED = 3
PAUSE_S = 60.0
_LONGEST_RESERVING_S = 10.0  # a process that has waited longer is taken for dead


@dataclass
class Page:
    """One process's part. Times are epoch seconds, 0 for never."""

    owner: str
    spent_usd: float = 0.0
    requests: int = 0
    waiting_since_s: float = 0.0
    last_turn_s: float = 0.0
    unanswered: int = 0  # questions in a row
    unanswered_s: float = 0.0


_pages = TypeAdapter(Page)


@dataclass
class SpendingLedger:
    """Budget (US dollars; None: no limit) and rate of one run. ``sleep`` and ``clock`` (epoch seconds) are for tests.

    Ledgers with the same ``files`` and ``name`` count together, in one process or many.
    """

    budget_usd: float | None = None
    requests_per_minute: float = 60.0
    files: Storage | None = None
    name: str = "run"
    sleep: Callable[[float], None] = time.sleep
    clock: Callable[[], float] = time.time
    _page: Page = field(default_factory=lambda: Page(uuid.uuid4().hex), repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def spent_usd(self) -> float:
        """Return the money spent by all processes so far, US dollars."""
        return math.fsum(page.spent_usd for page in self._all_pages())

    def reserve(self) -> None:
        """Wait for this request's turn.

        Raises: BudgetSpent: the budget is spent. TransientFailure: the provider has left several questions in a row
        unanswered; after a pause asking is allowed again.
        """
        with self._lock:
            now = self.clock()
            self._page.waiting_since_s = now
            self._put()
            try:
                turn_s = self._turn(now)
                self._page.last_turn_s = turn_s
                self._page.requests += 1
            finally:
                self._page.waiting_since_s = 0.0
                self._put()
        if turn_s > now:
            self.sleep(turn_s - now)

    def charge(self, cost_usd: float) -> None:
        """Record the cost of an answered request."""
        with self._lock:
            self._page.spent_usd += cost_usd
            self._page.unanswered = 0
            self._put()

    def unanswered(self) -> None:
        """Record that the provider left a question unanswered after all tries."""
        with self._lock:
            self._page.unanswered += 1
            self._page.unanswered_s = self.clock()
            self._put()

    def _turn(self, now: float) -> float:
        pages = self._all_pages()
        self._look_at_budget(math.fsum(page.spent_usd for page in pages))
        self._look_at_provider(pages, now)
        interval_s = 60.0 / self.requests_per_minute
        mine = (now, self._page.owner)
        before = sum(
            now - _LONGEST_RESERVING_S < page.waiting_since_s and (page.waiting_since_s, page.owner) < mine
            for page in pages
        )
        return max(now, max(page.last_turn_s for page in pages) + interval_s) + before * interval_s

    def _look_at_budget(self, spent_usd: float) -> None:
        if self.budget_usd is not None and spent_usd >= self.budget_usd:
            raise BudgetSpent(
                f"the budget of {self.budget_usd:g} USD for language models is spent ({spent_usd:.4f} USD); "
                "raise states.llm_budget_usd and run the failed crashes again"
            )

    @staticmethod
    def _look_at_provider(pages: Iterable[Page], now: float) -> None:
        silent = [page for page in pages if page.unanswered]
        in_a_row = sum(page.unanswered for page in silent)
        if in_a_row < MOST_UNANSWERED:
            return
        since_s = now - max(page.unanswered_s for page in silent)
        if since_s < PAUSE_S:
            raise TransientFailure(
                f"the model's provider left {in_a_row} questions in a row unanswered and is not asked for "
                f"{PAUSE_S:.0f} s; run the failed crashes again later",
                tried_again=True,
            )

    def _put(self) -> None:
        if self.files is not None:
            self.files.write(f"{self._folder}/{self._page.owner}.json", add_checksum(_pages.dump_json(self._page)))

    def _all_pages(self) -> list[Page]:
        """Return the pages of all processes, with this process's own from memory."""
        pages = [self._page]
        if self.files is not None:
            for data in self.files.read_many(sorted(self.files.list(self._folder))).values():
                try:
                    page = _pages.validate_python(check_document(data, name=self._folder))
                except (DamagedFile, ValidationError):
                    continue  # not a page of this ledger
                if page.owner != self._page.owner:
                    pages.append(page)
        return pages

    @property
    def _folder(self) -> str:
        return f"{FOLDER}/{self.name}"
