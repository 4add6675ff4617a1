"""Conflicts kept in an OpenSCENARIO file: the other party arrives when the free vehicle does.

Vehicles follow their trajectories without a clock. A ``SynchronizeAction`` brings them to the place of the contact
together with the free vehicle, at their recorded speed there. A vehicle ahead of it drives at the recorded share of its
speed. (A headway in seconds does not work, because it grows as the follower slows down.) A vehicle that would need more
than 0.4 g or 1.25 times its highest speed for that keeps its present speed. People begin to walk when the free vehicle,
at its present speed, is as many seconds from the place of the contact as recorded at the start: a time-to-collision
condition. All others follow the clock. So does a party that met a free vehicle which stood on its way, or that could
not arrive within these bounds at the recorded pace.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trace_dag.crash.parties import party_label, party_of_body
from trace_dag.reconstruction.motion.speeds import BRAKING_MPS2
from trace_dag.scenario.conflicts import is_ahead
from trace_dag.scenario.openscenario_elements import Element, element
from trace_dag.scenario.progress import FASTEST_PACE
from trace_dag.simulation.types import SimulationLog, VehicleLog

_STANDS_MPS = 0.5
_BEFORE_S = 0.05
_TOLERANCE_S = 0.02  # the same time for both: the same distance would be a longer time for the slower one


class Motion(Protocol):
    """A motion in its written form."""

    def pose_at(self, time_s: float) -> tuple[float, ...]:
        """Return x, y, z, heading, pitch and roll at a time."""


@dataclass(frozen=True)
class KeptConflict:
    """The free vehicle by name, and the contact as recorded.

    It has both parties' poses (x, y, z, heading, pitch, roll) at the contact, the time (s), both speeds there and the
    other's highest permitted speed (m/s), and whether the other is a person or drives ahead.
    """

    free: str
    free_place: tuple[float, ...]
    place: tuple[float, ...]
    contact_s: float
    free_mps: float
    speed_mps: float
    most_mps: float
    walks: bool
    leads: bool

    @classmethod
    def of(cls, log: SimulationLog, free: int, other: int, motions: Mapping[str, Motion]) -> KeptConflict | None:
        """Return the conflict of a free vehicle with another body, perhaps a trailer.

        None if they were not the first to touch each other, or if the other one stands there.
        """
        contact = next((each for each in log.contacts if free in (each.number_1, each.number_2)), None)
        if contact is None or {contact.number_1, contact.number_2} != {free, party_of_body(other)}:
            return None
        free_mps, speed_mps = (
            abs(float(np.interp(contact.time_s - _BEFORE_S, each.time_s, each.speed_mps)))
            for each in (log.vehicle_log(free), log.vehicle_log(other))
        )
        walks = log.is_figure(other)
        own, others = (log.vehicle_log(each) for each in (free, other))
        before = others.time_s < contact.time_s
        stood = np.abs(own.speed_mps[own.time_s < contact.time_s]).min(initial=math.inf) < _STANDS_MPS
        most_mps = FASTEST_PACE * float(np.abs(others.speed_mps[before]).max(initial=0.0))
        if stood or (not walks and not _arrives_within(others, contact.time_s, speed_mps, most_mps)):
            return None
        names = party_label(free), party_label(other)
        free_place, place = (motions[name].pose_at(contact.time_s) for name in names)
        (x, y, _, heading, *_), (other_x, other_y, _, other_heading, *_) = free_place, place
        leads = is_ahead((x, y, heading), (other_x, other_y, other_heading))
        return cls(names[0], free_place, place, contact.time_s, free_mps, speed_mps, most_mps, walks, leads)

    def timing(self) -> Element:
        """Return the time reference of the trajectory."""
        if self.walks:
            return element("Timing", domainAbsoluteRelative="relative", scale=1.0, offset=0.0)
        return element("None")

    def sets_out(self, name: str, at_start: Element) -> Element:
        """Return the start condition of the party; for a vehicle it is ``at_start``."""
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
        """Return the action that brings a vehicle to its place; None for people."""
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

    def keeps_speed(self, name: str) -> tuple[list[Element], Element]:
        """Return the conditions on which a vehicle stops adapting, and the action that follows."""
        by = element("TriggeringEntities", element("EntityRef", entityRef=name), triggeringEntitiesRule="any")
        limit_mps2 = round(BRAKING_MPS2, 3)
        limits = (
            element("SpeedCondition", value=round(self.most_mps, 3), rule="greaterThan"),
            element("AccelerationCondition", value=limit_mps2, rule="greaterThan", direction="longitudinal"),
            element("AccelerationCondition", value=-limit_mps2, rule="lessThan", direction="longitudinal"),
        )
        conditions = [
            element(
                "Condition",
                element("ByEntityCondition", copy(by), element("EntityCondition", limit)),
                name=f"{name}_limit_{number}",
                delay=0.0,
                conditionEdge="none",
            )
            for number, limit in enumerate(limits, 1)
        ]
        at_once = element("SpeedActionDynamics", dynamicsShape="step", value=0.0, dynamicsDimension="time")
        same = element("RelativeTargetSpeed", entityRef=name, value=0.0, speedTargetValueType="delta", continuous=False)
        action = element("SpeedAction", at_once, element("SpeedActionTarget", same))
        return conditions, element("PrivateAction", element("LongitudinalAction", action))

    def _final_speed(self) -> Element:
        if self.leads and self.free_mps > _STANDS_MPS:
            share = round(self.speed_mps / self.free_mps, 4)
            return element("RelativeSpeedToMaster", value=share, speedTargetValueType="factor")
        return element("AbsoluteSpeed", value=round(self.speed_mps, 3))


def _arrives_within(other: VehicleLog, contact_s: float, speed_mps: float, most_mps: float) -> bool:
    """Return whether a vehicle arrives as recorded after two even changes of its speed, as players drive it.

    The changes stay within the bounds of persistent traffic; a vehicle that stands there does not arrive.
    """
    before = other.time_s <= contact_s
    length_m = float(np.hypot(np.diff(other.x_m[before]), np.diff(other.y_m[before])).sum())
    first_mps = abs(float(other.speed_mps[0]))
    middle_mps = 2 * length_m / contact_s - (first_mps + speed_mps) / 2
    harshest_mps2 = max(abs(middle_mps - first_mps), abs(speed_mps - middle_mps)) / (contact_s / 2)
    return speed_mps >= _STANDS_MPS and 0.0 <= middle_mps <= most_mps and harshest_mps2 <= BRAKING_MPS2


def _world(place: Sequence[float], name: str = "Position") -> Element:
    x, y, z, heading, pitch, roll = place
    return element(name, element("WorldPosition", x=x, y=y, z=z, h=heading, p=pitch, r=roll))
