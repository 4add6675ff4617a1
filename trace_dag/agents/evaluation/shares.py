"""Shares of runs with the interval that the number of crashes leaves open: both drivers of a crash count once.

Their chart is an SVG small enough for an event log: bars, each with its range.
"""

from __future__ import annotations

import html
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np

from trace_dag.agents.evaluation.metrics import AVOIDED
from trace_dag.common.geometry import FloatArray

_Z_95 = 1.959964  # of the normal distribution, two-sided 95 %
_ROW_PX, _BAR_PX, _COUNT_PX = 22, 240, 90
_SIGN_PX = 7  # a sign of a label is hardly ever wider


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
    >>> share.part, share.of, share.crashes, round(share.low, 2)  # one crash counts as one, for every driver
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


# --- chart -----------------------------------------------------------------------------------------------------------
class Share(NamedTuple):
    """``part`` of ``of`` cases; ``of`` may be 0."""

    label: str
    part: int
    of: int


def data_url(svg: str) -> str:
    """Return an SVG as a data URL for Markdown.

    >>> data_url("<svg/>")
    'data:image/svg+xml,%3Csvg/%3E'
    """
    return f"data:image/svg+xml,{quote(svg, safe='/=:,')}"


def share_chart(title: str, shares: Sequence[Share]) -> str:
    """Return an SVG with one bar for each share, from 0 to 100 %, and its 95 % interval as a line."""
    height = _ROW_PX * (len(shares) + 2)
    label_px = 16 + _SIGN_PX * max((len(share.label) for share in shares), default=0)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{label_px + _BAR_PX + _COUNT_PX}" height="{height}" '
        'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>',
        f'<text x="6" y="15" font-weight="bold">{html.escape(title)}</text>',
    ]
    for row, share in enumerate(shares, 1):
        y = row * _ROW_PX
        lines.append(f'<text x="{label_px - 8}" y="{y + 15}" text-anchor="end">{html.escape(share.label)}</text>')
        if share.of:
            low, high = (label_px + _BAR_PX * bound for bound in wilson_interval(share.part, share.of))
            width = _BAR_PX * share.part / share.of
            lines += [
                f'<rect x="{label_px}" y="{y + 4}" width="{width:.1f}" height="{_ROW_PX - 8}" fill="#56b4e9"/>',
                f'<path d="M{low:.1f} {y + 11}H{high:.1f}" stroke="#333" stroke-width="2"/>',
            ]
        lines.append(f'<text x="{label_px + _BAR_PX + 8}" y="{y + 15}">{share.part} of {share.of}</text>')
    bottom = _ROW_PX * (len(shares) + 1)
    lines.append(f'<path d="M{label_px} {_ROW_PX}V{bottom}H{label_px + _BAR_PX}" stroke="#888" fill="none"/>')
    for percent in (0, 50, 100):
        x = label_px + _BAR_PX * percent / 100
        lines.append(f'<text x="{x:.0f}" y="{bottom + 15}" text-anchor="middle" fill="#555">{percent} %</text>')
    return "\n".join([*lines, "</svg>"])
