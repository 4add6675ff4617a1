"""Progress of a participant along its recorded path, and its arrival."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, arc_lengths
from trace_dag.roads.map.lane_map import PathFollower, path_through
from trace_dag.scenario.cases import MOST_TIMES, Case
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.types import Contact, VehicleLog

FASTEST_PACE: Final = 1.25
"""Margin for a driver: about 15 km/h more at 60 km/h, what recorded and reported speeds differ by."""
GOAL_BEYOND_M: Final = 50.0
"""So far beyond the conflict, or at the end of its recorded way, an agent has finished."""
PAST_M: Final = 5.0
"""So far beyond the place of its conflict, about its own length, an agent has got past it."""
_MOVES_M = 0.01  # between two points of a plan
_SPACING_M = 0.5
_LEAST_WAY_M = 1.0
_REACHES_M = 1.0  # a controller keeps to its place within so much


class RecordedWay:
    """The path of a participant without the crash: its places by distance (m), with their times (s)."""

    def __init__(self, case: Case, number: int) -> None:
        plan = next(each.trajectory for each in case.going_on if each.number == number)
        self._time_s: FloatArray = plan.time_s
        self._points = np.column_stack([plan.x_m, plan.y_m])
        self._along_m = arc_lengths(self._points)
        self._end_s = case.end_s
        contact = contact_with(case, number)
        self.conflict_s = case.impact_time_s if contact is None else contact.time_s
        """When it was in the conflict: at its first recorded contact, of a near miss at the planned impact."""
        self.conflict_m = self.at(self.conflict_s)
        self.goal_m = min(self.conflict_m + GOAL_BEYOND_M, self.at(case.end_s))

    def at(self, time_s: float) -> float:
        """Return the distance covered at a time, m."""
        return float(np.interp(time_s, self._time_s, self._along_m))

    def time_at(self, along_m: float) -> float:
        """Return the time at a place, s; if the participant stood there, the time of driving on."""
        after = int(np.searchsorted(self._along_m, along_m + _MOVES_M, side="right"))
        if after == 0:
            return 0.0
        if after == len(self._along_m):
            return float(self._time_s[-1])
        before = self._along_m[after - 1]
        share = (along_m - before) / (self._along_m[after] - before)
        return float(self._time_s[after - 1] + max(share, 0.0) * (self._time_s[after] - self._time_s[after - 1]))

    def speed_mps(self, time_s: float) -> float:
        """Return the speed at a time, over a fifth of a second."""
        return (self.at(time_s + 0.1) - self.at(time_s - 0.1)) / (min(time_s, 0.1) + 0.1)

    @property
    def limit_s(self) -> float:
        """Return the end of a run: twice the recorded time to the goal."""
        return max(self._end_s, MOST_TIMES * self.time_at(self.goal_m)) if self.goal_m > _MOVES_M else self._end_s

    def follower(self) -> PathFollower | None:
        """Return the search for places on the path; None for a standing participant."""
        length_m = float(self._along_m[-1])
        if length_m < _LEAST_WAY_M:
            return None
        along_m = np.arange(0.0, length_m, _SPACING_M)
        return PathFollower(
            path_through(np.column_stack([np.interp(along_m, self._along_m, each) for each in self._points.T]))
        )

    def is_finished(self, log: VehicleLog) -> bool:
        """Return whether a vehicle reached the goal."""
        return self._reaches(log, self.goal_m)

    def is_past_conflict(self, log: VehicleLog) -> bool:
        """Return whether a vehicle got past the place of its conflict, or to its goal if that is nearer."""
        return self._reaches(log, min(self.conflict_m + PAST_M, self.goal_m))

    def _reaches(self, log: VehicleLog, place_m: float) -> bool:
        follower = self.follower()
        if follower is None:
            return True
        every = slice(None, None, max(1, len(log.time_s) // 500))
        points = np.column_stack([log.x_m, log.y_m])
        reached_m = place_m - _REACHES_M
        return any(follower.locate(x, y)[0] >= reached_m for x, y in [*points[every].tolist(), points[-1].tolist()])


class Arrival:
    """The arrival of a participant at its goal, observed during the run.

    It is not before the recorded end, because until then others may run into it.
    """

    def __init__(self, case: Case, number: int, way: RecordedWay) -> None:
        self.reached = False
        self._number, self._from_s = number, case.end_s
        self._follower, self._goal_m = way.follower(), way.goal_m - _REACHES_M

    def look(self, time_s: float, states: Mapping[int, BodyState]) -> None:
        """Look at its place now."""
        state = states[self._number]
        at_m = self._follower.locate(state.x_m, state.y_m)[0] if self._follower is not None else self._goal_m
        self.reached = time_s >= self._from_s and (self.reached or at_m >= self._goal_m)


def contact_with(case: Case, number: int) -> Contact | None:
    """Return the first recorded contact of a participant, or None."""
    contacts = [each for each in case.recorded.contacts if number in (each.number_1, each.number_2)]
    return min(contacts, key=lambda contact: contact.time_s, default=None)
