"""What a verdict is: criteria, each with its value, threshold and whether it holds."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.errors import Reason


@dataclass(frozen=True)
class Criterion:
    """``passed`` is None where the report gives nothing to compare with: shown as not evaluated, never as a pass.

    ``reason`` is what a crash is rejected for if this criterion fails; None for criteria that are only reported.
    """

    name: str
    value: float | None
    threshold: float | None
    unit: str
    passed: bool | None
    reason: Reason | None = None
    detail: str = ""
    vehicle_number: int | None = None


@dataclass(frozen=True)
class Verdict:
    """The judgement of one crash: of the first hypothesis (in the estimate's order) that satisfies the rules, or of
    the first one if none does."""

    key: str
    rule_set: str
    accepted: bool
    hypothesis: int  # index in the estimate
    hypotheses_judged: int
    criteria: tuple[Criterion, ...]
    reason: Reason | None = None  # why it is rejected
    detail: str = ""

    def criterion(self, name: str, vehicle_number: int | None = None) -> Criterion | None:
        """The criterion of that name (and vehicle), if it was measured."""
        for criterion in self.criteria:
            if criterion.name == name and criterion.vehicle_number == vehicle_number:
                return criterion
        return None

    def worst(self, *names: str) -> float | None:
        """The largest size of the named criteria's values, over both vehicles; None if none was evaluated."""
        return max((abs(c.value) for c in self.criteria if c.name in names and c.value is not None), default=None)

    def all_hold(self, name: str) -> bool | None:
        """Whether every criterion of that name holds of those that were evaluated; None if none was."""
        evaluated = [c.passed for c in self.criteria if c.name == name and c.passed is not None]
        return all(evaluated) if evaluated else None
