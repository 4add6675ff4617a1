"""Products of a stage for one crash."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from trace_dag.common.errors import Rejection

Figure = str | float | int | bool | None


@dataclass(frozen=True)
class StageProduct:
    """The product of a stage: contents by file extension, and the main figures.

    A rejected crash can still have artefacts (a log without a collision, a negative verdict); ``rejection`` then has
    the reason. Without artefacts a stage raises the :class:`Rejection` instead. ``parsed`` has, by extension, the exact
    result of the artefact's reader, if the stage has it at hand.
    """

    files: Mapping[str, bytes]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    rejection: Rejection | None = None
    parsed: Mapping[str, object] = field(default_factory=dict)
