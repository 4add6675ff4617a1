"""Rejections, failures and errors of users, three kinds that are never mixed.

* :class:`Rejection`: the crash was examined and is excluded for a stated, measured reason. That is data.
* :class:`Failure` (and :class:`TransientFailure`): something of ours or of a service broke. That is retried.
* :class:`UserError`: the caller asked for something impossible; shown as one line, without a traceback.

Every reason a crash can be rejected for is declared here, once. ``reasons.csv`` has the stage that gives it, the
category of the published paper (TRACE, FSE Companion '26) it belongs to, its meaning, and the remedy.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from functools import cache

from trace_dag.common.data_files import read_csv
from trace_dag.common.stage import Stage


class PublishedCategory(StrEnum):
    """The paper's reasons for losing a report: 100 reports, 65 after the map stage, 52 verified."""

    VERTICAL_GEOMETRY = "vertical geometry"
    INCOMPLETE_INFORMATION = "incomplete information"
    INCONSISTENT_LOCATION = "inconsistent crash location"
    NOT_REPRODUCED = "not reproduced"
    NOT_IN_PAPER = "not in the paper"


class Reason(StrEnum):
    """Reasons of rejections.

    The value is the reason code in artefacts and tables.
    """

    NOT_RELEASED = "not_released"
    MALFORMED_REPORT = "malformed_report"
    INCOMPLETE_LOCATION = "incomplete_location"
    INCOMPLETE_TOPOLOGY = "incomplete_topology"
    INCOMPLETE_TRAJECTORY = "incomplete_trajectory"
    INCOMPLETE_IMPACT = "incomplete_impact"
    OUTSIDE_COHORT = "outside_cohort"
    NOT_MODELLED = "not_modelled"
    INCOMPLETE_SEQUENCE = "incomplete_sequence"
    NO_MAP_COVERAGE = "no_map_coverage"
    MAP_DISTORTED = "map_distorted"
    CRASH_OFF_ROAD = "crash_off_road"
    VERTICAL_GEOMETRY = "vertical_geometry"
    MAP_TOO_SMALL = "map_too_small"
    NO_FEASIBLE_STATE = "no_feasible_state"
    NO_COLLISION = "no_collision"
    NO_DEPARTURE = "no_departure"
    WRONG_SIDE = "wrong_side"
    NO_OVERTURN = "no_overturn"
    WRONG_LOCATION = "wrong_location"
    WRONG_PARTY = "wrong_party"
    WRONG_IMPACT = "wrong_impact"
    WRONG_SEQUENCE = "wrong_sequence"
    WRONG_ZONE = "wrong_zone"
    WRONG_DIRECTION = "wrong_direction"
    WRONG_SPEED = "wrong_speed"  # only under the rule set "strict"

    @property
    def stage(self) -> Stage:
        """Return the stage that rejects with this reason."""
        return Stage(_facts()[self]["stage"])

    @property
    def published_category(self) -> PublishedCategory:
        """Return the paper's category this reason is counted under."""
        return PublishedCategory(_facts()[self]["published_category"])

    @property
    def meaning(self) -> str:
        """Return its meaning for the crash, in a sentence."""
        return _facts()[self]["meaning"]

    @property
    def remedy(self) -> str:
        """Return the remedy, in a sentence."""
        return _facts()[self]["remedy"]


@cache
def _facts() -> dict[str, dict[str, str]]:
    return {row["reason"]: row for row in read_csv("trace_dag.common", "reasons.csv")}


class Rejection(Exception):  # noqa: N818 - a rejection is an outcome, not an error
    """The crash is excluded for ``reason``; ``detail`` is one sentence that names what was measured.

    ``measured`` and ``threshold`` carry the number behind the sentence where there is one, in the unit the
    sentence states (metres, hours of the clock, vehicles, ...).
    """

    def __init__(
        self, reason: Reason, detail: str, *, measured: float | None = None, threshold: float | None = None
    ) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail
        self.measured = measured
        self.threshold = threshold

    def __reduce__(self) -> tuple[object, ...]:
        # Exceptions with keyword arguments do not survive a process pool without this.
        return (_rebuild_rejection, (self.reason, self.detail, self.measured, self.threshold))


def _rebuild_rejection(reason: Reason, detail: str, measured: float | None, threshold: float | None) -> Rejection:
    return Rejection(reason, detail, measured=measured, threshold=threshold)


class Failure(Exception):  # noqa: N818 - Dagster's word for it
    """A stage broke for a reason outside the crash: it must be repaired or retried, never counted."""


class TransientFailure(Failure):
    """A failure that may pass by itself (time-out, 429, 5xx, a lost worker): retried by policy.

    ``tried_again``: all attempts that the settings allow were made before it was raised.
    """

    def __init__(self, message: str, *, tried_again: bool = False) -> None:
        super().__init__(message)
        self.tried_again = tried_again


class BudgetSpent(Failure):
    """A service whose budget is spent."""


class DamagedFile(Failure):
    """A stored file that differs from what was written. ``found`` describes it, ``remedy`` repairs it."""

    def __init__(self, name: str, found: str, remedy: str = "") -> None:
        super().__init__(f"{name}: damaged: {found}" + (f"; {remedy}" if remedy else ""))
        self.name = name
        self.found = found
        self.remedy = remedy

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.name, self.found, self.remedy))

    def mended_by(self, remedy: str) -> DamagedFile:
        """Return the same damage with its remedy in the message."""
        return DamagedFile(self.name, self.found, remedy)


class UserError(Exception):
    """A request that cannot be met; the message names what was found, what was expected and what to do."""


class UserErrors(UserError):  # noqa: N818 - several of them
    """Several at once, each a line of its own."""

    def __init__(self, messages: Iterable[str]) -> None:
        self.messages = tuple(messages)
        super().__init__("; ".join(self.messages))

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.messages,))
