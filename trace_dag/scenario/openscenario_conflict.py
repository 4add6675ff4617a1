"""What keeps a conflict in an OpenSCENARIO file: whoever met the free vehicle comes when it comes.

Vehicles go along their trajectories without a clock, and a ``SynchronizeAction`` brings them to their place of the
contact when the free vehicle is at its own, at the speed they had there; whoever drives ahead of it at the recorded
share of its speed. (A headway in seconds would not do: the slower the one who follows, the longer it is.) People begin
to walk when the free vehicle, at its pace of now, is as long from the place of the contact as it was recorded to be at
the start: a time-to-collision condition. Everybody else goes by the clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trace_dag.crash.parties import party_label, party_of_body
from trace_dag.evaluation.conflicts import is_ahead
from trace_dag.scenario.openscenario_elements import Element, element
from trace_dag.sim.types import SimulationLog

_STANDS_MPS = 0.5
_BEFORE_S = 0.05
_TOLERANCE_S = 0.02  # the same time for both: the same distance would be a longer time for the slower one


class Motion(Protocol):
    """A motion as it is written."""

    def pose_at(self, time_s: float) -> tuple[float, ...]:
        """x, y, z, heading, pitch and roll at a time."""


@dataclass(frozen=True)
class KeptConflict:
    """The free vehicle by name, its and the other's places (x, y, z, heading, pitch, roll) at the contact, when that
    was recorded (s), how fast either came there (m/s), whether the other one is a person, and whether it drives ahead.
    """

    free: str
    free_place: tuple[float, ...]
    place: tuple[float, ...]
    contact_s: float
    free_mps: float
    speed_mps: float
    walks: bool
    leads: bool

    @classmethod
    def of(cls, log: SimulationLog, free: int, other: int, motions: Mapping[str, Motion]) -> KeptConflict | None:
        """The conflict of a free vehicle with another body, a trailer too; None if they were not the first to touch
        each other, or that one stands there."""
        contact = next((each for each in log.contacts if free in (each.number_1, each.number_2)), None)
        if contact is None or {contact.number_1, contact.number_2} != {free, party_of_body(other)}:
            return None
        free_mps, speed_mps = (
            abs(float(np.interp(contact.time_s - _BEFORE_S, each.time_s, each.speed_mps)))
            for each in (log.vehicle_log(free), log.vehicle_log(other))
        )
        walks = log.is_figure(other)
        if speed_mps < _STANDS_MPS and not walks:
            return None
        names = party_label(free), party_label(other)
        free_place, place = (motions[name].pose_at(contact.time_s) for name in names)
        (x, y, _, heading, *_), (other_x, other_y, _, other_heading, *_) = free_place, place
        leads = is_ahead((x, y, heading), (other_x, other_y, other_heading))
        return cls(names[0], free_place, place, contact.time_s, free_mps, speed_mps, walks, leads)

    def timing(self) -> Element:
        """The time reference of the trajectory."""
        if self.walks:
            return element("Timing", domainAbsoluteRelative="relative", scale=1.0, offset=0.0)
        return element("None")

    def sets_out(self, name: str, at_start: Element) -> Element:
        """The condition on which it sets out: a vehicle at the start."""
        if not self.walks:
            return at_start
        by = element("TriggeringEntities", element("EntityRef", entityRef=self.free), triggeringEntitiesRule="any")
        near = element(
            "TimeToCollisionCondition",
            element("TimeToCollisionConditionTarget", _world(self.free_place)),
            value=round(self.contact_s, 4),
            rule="lessOrEqual",
            freespace=False,
            coordinateSystem="entity",
            relativeDistanceType="euclidianDistance",
        )
        said = element("ByEntityCondition", by, element("EntityCondition", near))
        return element("Condition", said, name=name, delay=0.0, conditionEdge="none")

    def synchronized(self) -> Element | None:
        """The action that brings a vehicle to its place; None of people."""
        if self.walks:
            return None
        action = element(
            "SynchronizeAction",
            _world(self.free_place, "TargetPositionMaster"),
            _world(self.place, "TargetPosition"),
            element("FinalSpeed", self._final_speed()),
            masterEntityRef=self.free,
            targetToleranceMaster=round(_TOLERANCE_S * self.free_mps, 3),
            targetTolerance=round(_TOLERANCE_S * self.speed_mps, 3),
        )
        return element("PrivateAction", action)

    def _final_speed(self) -> Element:
        if self.leads and self.free_mps > _STANDS_MPS:
            share = round(self.speed_mps / self.free_mps, 4)
            return element("RelativeSpeedToMaster", value=share, speedTargetValueType="factor")
        return element("AbsoluteSpeed", value=round(self.speed_mps, 3))


def _world(place: Sequence[float], name: str = "Position") -> Element:
    x, y, z, heading, pitch, roll = place
    return element(name, element("WorldPosition", x=x, y=y, z=z, h=heading, p=pitch, r=roll))
