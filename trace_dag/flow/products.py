"""Products of a stage for one crash."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from trace_dag.common.errors import Rejection

Figure = str | float | int | bool | None


@dataclass(frozen=True)
class StageProduct:
    """The product of a stage: contents by file extension, and the few figures that a person looks at first.

    A crash can be rejected and still leave artefacts to look at (a log without a collision, a negative verdict): then
    ``rejection`` says why. Without artefacts a stage raises the :class:`Rejection` instead. ``parsed`` holds, by
    extension, what the artefact's reader would make of it, to the bit, where the stage has it at hand.
    """

    files: Mapping[str, bytes]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    rejection: Rejection | None = None
    parsed: Mapping[str, object] = field(default_factory=dict)
