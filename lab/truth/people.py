"""Estimates of the sample's crashes with people against the truth: which way the person went, and where it was struck.

Belongs here: ``people/truth.json`` of the sample. A person's true speed is in no report, so that no error of it is
measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from pydantic import BaseModel, ConfigDict, ValidationError

from lab.truth.vehicles import Expectation, TruePoint, TruePose
from trace_dag.common.errors import UserError
from trace_dag.common.units import wrap_angle
from trace_dag.simulation.states import StateEstimate

MAX_COURSE_ERROR_DEG = 45.0
"""A person headed further away from the true course went another way."""


class _Row(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class TruePerson(_Row):
    """The true course of one person.

    ``told``: the report has the direction; ``number`` is the party's.
    """

    number: int
    course: str
    told: bool
    speed_mps: float
    initial_pose: TruePose
    impact_pose: TruePose


class TrueStrike(_Row):
    """One crash with people; one that must be rejected has none."""

    key: str
    title: str
    kind: str
    expected: Expectation
    impact_point: TruePoint | None = None
    people: tuple[TruePerson, ...] = ()


class PeopleTruth(_Row):
    """The file as a whole."""

    crashes: tuple[TrueStrike, ...]


@dataclass(frozen=True)
class PersonTruthRow:
    """One person of one crash and the errors of its estimate, None without one."""

    key: str
    title: str
    kind: str
    told: bool
    course: str
    course_error_deg: float | None = None  # heading at the strike
    impact_point_error_m: float | None = None

    @property
    def course_correct(self) -> bool | None:
        """Return whether the person went the true way."""
        return None if self.course_error_deg is None else self.course_error_deg <= MAX_COURSE_ERROR_DEG


@dataclass(frozen=True)
class KindSummary:
    """The people of one kind of crash. ``course_told_share`` is over the people whose report has their direction."""

    kind: str
    people: int
    estimated: int
    course_told_share: float | None
    course_open_share: float | None
    median_impact_point_error_m: float | None
    worst_impact_point_error_m: float | None


def load_people_truth(path: Path) -> PeopleTruth:
    """Return reads ``people/truth.json``.

    Raises :class:`UserError` if there is no such file or it is not one.
    """
    try:
        return PeopleTruth.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise UserError(f"{path}: not the truth of the sample's crashes with people ({error})") from error


def score_people(
    truth: PeopleTruth, estimates: Mapping[str, StateEstimate], hypothesis: Mapping[str, int] | None = None
) -> list[PersonTruthRow]:
    """Return a row for each person of each crash with a truth; ``hypothesis`` as :func:`lab.truth.vehicles.score_truth`
    has it.
    """
    rows = []
    for crash in truth.crashes:
        made = estimates.get(crash.key)
        for person in crash.people:
            row = PersonTruthRow(crash.key, crash.title, crash.kind, person.told, person.course)
            if made is not None and crash.impact_point is not None:
                chosen = made.hypotheses[(hypothesis or {}).get(crash.key, 0)]
                state = next((each for each in chosen.participants if each.vehicle_number == person.number), None)
                if state is not None:
                    apart = wrap_angle(state.impact_pose.heading_rad - person.impact_pose.heading_rad)
                    at = (crash.impact_point.x_m, crash.impact_point.y_m)
                    row = PersonTruthRow(
                        *(crash.key, crash.title, crash.kind, person.told, person.course),
                        course_error_deg=abs(math.degrees(apart)),
                        impact_point_error_m=math.dist(chosen.impact_point_xy_m, at),
                    )
            rows.append(row)
    return rows


def by_kind(rows: Iterable[PersonTruthRow]) -> list[KindSummary]:
    """Return the summary of the rows, a line for each kind of crash."""
    of_kind: dict[str, list[PersonTruthRow]] = {}
    for row in rows:
        of_kind.setdefault(row.kind, []).append(row)
    return [_summary(kind, found) for kind, found in of_kind.items()]


def _summary(kind: str, rows: list[PersonTruthRow]) -> KindSummary:
    errors = [row.impact_point_error_m for row in rows if row.impact_point_error_m is not None]
    told, left_open = (
        [row.course_correct for row in rows if row.told is wanted and row.course_correct is not None]
        for wanted in (True, False)
    )
    return KindSummary(
        kind,
        len(rows),
        len(errors),
        sum(told) / len(told) if told else None,
        sum(left_open) / len(left_open) if left_open else None,
        median(errors) if errors else None,
        max(errors, default=None),
    )
