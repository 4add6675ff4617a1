"""Shares as bars, each with the range that its number of cases leaves open: an SVG small enough for an event log."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import NamedTuple
from urllib.parse import quote

from trace_dag.agents.evaluation.shares import wilson_interval

_ROW_PX, _BAR_PX, _COUNT_PX = 22, 240, 90
_SIGN_PX = 7  # a sign of a label is hardly ever wider


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
