"""Shares of runs with the interval that the number of crashes leaves open: both drivers of a crash count once."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from trace_dag.agents.evaluation.metrics import AVOIDED
from trace_dag.common.geometry import FloatArray

_Z_95 = 1.959964  # of the normal distribution, two-sided 95 %


class ClusteredShare(NamedTuple):
    """``part`` of ``of`` runs in ``crashes`` crashes, and the 95 % interval of the share."""

    part: float
    of: float
    crashes: int
    low: float
    high: float


def wilson_interval(part: float, of: float) -> tuple[float, float]:
    """Return the 95 % interval of a share that was seen in ``part`` of ``of`` cases (Wilson, JASA 22, 1927).

    >>> [round(bound, 3) for bound in wilson_interval(5, 10)]
    [0.237, 0.763]
    """
    if of == 0:
        return 0.0, 1.0
    share, z2 = part / of, _Z_95**2
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = _Z_95 * math.sqrt(share * (1 - share) / of + z2 / (4 * of**2)) / (1 + z2 / of)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def share_avoided(runs: Iterable[Mapping[str, Any]]) -> ClusteredShare:
    """Return the share of runs (rows of the table of evaluations) that avoided the crash, with crashes as units.

    >>> share = share_avoided([{"key": "2023-1", "outcome": "conflict_avoided"}] * 2)
    >>> share.part, share.of, share.crashes, round(share.low, 2)  # one crash says as much as one, whoever drove in it
    (2.0, 2.0, 1, 0.21)
    """
    return clustered_share((run["key"], run["outcome"] in AVOIDED) for run in runs)


def clustered_share(
    found: Iterable[tuple[str, float]], weights: Mapping[str, float] = MappingProxyType({})
) -> ClusteredShare:
    """Return the share of true values, or the mean of probabilities, each given with its crash.

    A crash without an entry in ``weights`` weighs 1.

    The interval is Wilson's for the effective number of crashes. It assumes that the drivers of a crash always fare
    alike, so it can be too wide but never too narrow.
    """
    part, runs = 0.0, defaultdict[str, float](float)
    for key, holds in found:
        weight = weights.get(key, 1.0)
        part += holds * weight
        runs[key] += weight
    of = sum(runs.values())
    worth = effective_number(np.array(list(runs.values())))
    low, high = wilson_interval(worth * part / of if of else 0.0, worth)
    return ClusteredShare(part, of, len(runs), low, high)


def effective_number(weights: FloatArray) -> float:
    """Return the number of crashes of equal weight that the weights amount to (Kish, Survey Sampling, 1965).

    >>> round(effective_number(np.array([3.0, 1.0])), 6)
    1.6
    """
    return float(weights.sum() ** 2 / (weights**2).sum()) if len(weights) else 0.0
