"""The summary of a run, counted from its events as they come: throughput, slowest crashes, retries, cost.

For all stored results, of whatever run, the warehouse's ``run_summary`` and ``stage_outcomes`` have the same figures in
SQL.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from trace_dag.common.messages.wording import count_of
from trace_dag.common.provenance import Outcome
from trace_dag.common.settings import StateSettings
from trace_dag.common.stage import Stage
from trace_dag.flow.crash_status import Made, maker_of, makers_in_words
from trace_dag.flow.tasks import Action, StageEvent

_SLOWEST_NAMED = 3
_USUAL_ESTIMATOR = StateSettings().estimator


@dataclass
class RunSummary:
    """A count of a run's events. Times are in seconds; ``computing_s`` is summed over crashes, by stage.

    ``without_picture`` has, by crash, the reason why its picture could not be drawn.
    """

    began: float = field(default_factory=time.monotonic)
    outcomes: Counter[Outcome] = field(default_factory=Counter)
    unchanged: int = 0
    retries: int = 0
    cost_usd: float = 0.0
    artefact_bytes: int = 0
    estimates: list[Made] = field(default_factory=list)
    without_picture: dict[str, str] = field(default_factory=dict)
    computing_s: dict[Stage, float] = field(default_factory=lambda: defaultdict(float))
    crash_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _crashes: set[str] = field(default_factory=set)

    def note(self, event: StageEvent) -> None:
        """Count one event; a stage skipped because an earlier one ended the crash adds nothing."""
        self._crashes.add(event.key)
        if event.no_picture:
            self.without_picture[event.key] = event.no_picture
        if event.action is Action.UNCHANGED:
            self.unchanged += 1
        record = event.record
        if event.action is not Action.COMPUTED or record is None:
            return
        self.outcomes[record.outcome] += 1
        self.retries += record.attempts - 1
        if event.stage is Stage.STATE_ESTIMATE and (made := maker_of(record)) is not None:
            self.estimates.append(made)
        cost = record.figures.get("cost_usd")
        if isinstance(cost, int | float):
            self.cost_usd += cost
        self.artefact_bytes += sum(file.size for file in record.artefacts)
        self.computing_s[event.stage] += record.duration_s
        self.crash_s[event.key] += record.duration_s

    @property
    def computed(self) -> int:
        """Return crashes for which at least one stage was computed."""
        return len(self.crash_s)

    @property
    def elapsed_s(self) -> float:
        """Return the time since the summary was begun."""
        return time.monotonic() - self.began

    def slowest(self, count: int = _SLOWEST_NAMED) -> list[tuple[str, float]]:
        """Return the crashes that took the longest, with their time in stages, s."""
        return sorted(self.crash_s.items(), key=lambda item: -item[1])[:count]

    def figures(self) -> dict[str, float | int | str]:
        """Return the summary as named figures."""
        elapsed_s = self.elapsed_s
        return {
            "crashes": len(self._crashes),
            "crashes_computed": self.computed,
            "stages_computed": sum(self.outcomes.values()),
            "stages_unchanged": self.unchanged,
            "rejected": self.outcomes[Outcome.REJECTED],
            "failed": self.outcomes[Outcome.FAILED],
            "retries": self.retries,
            "fallback_estimates": sum(made.fallback_from is not None for made in self.estimates),
            "pictures_missing": len(self.without_picture),
            "cost_usd": round(self.cost_usd, 6),
            "artefact_bytes": self.artefact_bytes,
            "elapsed_s": round(elapsed_s, 2),
            "computing_s": round(sum(self.computing_s.values()), 2),
            "crashes_per_minute": round(60.0 * self.computed / elapsed_s, 1) if elapsed_s > 0 else 0.0,
            "slowest": ", ".join(f"{key} {seconds:.1f} s" for key, seconds in self.slowest()),
            "slowest_stage": str(max(self.computing_s, key=lambda stage: self.computing_s[stage], default="")),
        }

    def in_words(self) -> str:
        """Return the summary as one line."""
        figures = self.figures()
        crashes = count_of(len(self._crashes), "crash", "crashes")
        parts = [
            f"{self.computed} of {crashes} computed in {figures['elapsed_s']:.1f} s"
            f" ({figures['crashes_per_minute']:.0f} per minute)"
        ]
        if figures["slowest"]:
            parts.append(f"slowest {figures['slowest']}")
            parts.append(f"most time in {figures['slowest_stage']}")
        parts.append(count_of(self.retries, "retry", "retries"))
        parts.append(f"${self.cost_usd:.4f} for language models" if self.cost_usd else "no cost")
        if any(made.estimator != _USUAL_ESTIMATOR or made.fallback_from for made in self.estimates):
            parts.append(makers_in_words(self.estimates))
        if self.without_picture:
            key, why = next(iter(self.without_picture.items()))
            parts.append(f"pictures missing: {len(self.without_picture)} ({key}: {why})")
        return "; ".join(parts)
