"""The estimators of some estimates, and the numbers of fallbacks, as a sentence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from trace_dag.common.messages.wording import count_of
from trace_dag.common.provenance import OutcomeRecord


class Made(NamedTuple):
    """The estimator of an estimate, and the requested one if that was another."""

    estimator: str
    fallback_from: str | None = None


def maker_of(record: OutcomeRecord) -> Made | None:
    """Return the estimator in a stage's record; None without an estimate."""
    estimator, asked = record.figures.get("estimator"), record.figures.get("fallback_from")
    if not estimator or not record.artefacts or record.reason is not None:
        return None
    return Made(str(estimator), str(asked) if asked else None)


def makers_in_words(estimates: Iterable[Made]) -> str:
    """Return a sentence such as "50 estimates: 14 by llm, 36 by analytic in place of llm (72 %)".

    "" without estimates.
    """
    counts = Counter(estimates)
    total = counts.total()
    if not total:
        return ""
    parts = [
        f"{count} by {made.estimator}"
        + (f" in place of {made.fallback_from} ({100 * count / total:.0f} %)" if made.fallback_from else "")
        for made, count in sorted(
            counts.items(), key=lambda item: (item[0].fallback_from is not None, item[0].estimator)
        )
    ]
    return f"{count_of(total, 'estimate')}: {', '.join(parts)}"
