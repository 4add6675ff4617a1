"""The verdict of a crash in which a vehicle overturns before it strikes anything: that it does, where, to which side.

A vehicle has overturned once it is tilted by 60 degrees; that is where its overturn is. The reported point of one
beside the road lies on the road, so that the distance is measured along it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.crash.departures import DepartureSide, departure_of
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import event_named
from trace_dag.errors import Failure, Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadsidePlace, roadside_at
from trace_dag.settings import VerdictSettings
from trace_dag.sim.leaving_road import left_road
from trace_dag.sim.types import SimulationLog, overturned_at
from trace_dag.verdict.departed_street import NO_STREET, DepartedStreet, departed_street, street_criterion
from trace_dag.verdict.departures import along_road_m, departing
from trace_dag.verdict.metrics import speed_error_rel
from trace_dag.verdict.rules import RULE_SETS, at_most, shown, speed_criterion
from trace_dag.verdict.types import Criterion


@dataclass(frozen=True)
class ObservedOverturn:
    """What a vehicle did: when and where it overturned, how far along the road that is from the reported point, when it
    left the carriageway before that (None if it did not) and to where, its speed at the start and at the overturn, how
    far it slid from there, and its quarter turns."""

    time_s: float
    xy_m: tuple[float, float]
    place: RoadsidePlace | None
    along_m: float
    left_s: float | None
    sides: tuple[DepartureSide, ...]
    initial_speed_mps: float
    speed_mps: float
    slid_m: float
    quarter_turns: int
    street: DepartedStreet = NO_STREET


def observe_overturn(network: RoadNetwork, log: SimulationLog) -> ObservedOverturn | None:
    """The overturn of a simulated hypothesis; None if there was none."""
    over = {vehicle.number: overturned_at(vehicle) for vehicle in log.parties}
    found = [(step, vehicle) for vehicle in log.parties if (step := over[vehicle.number]) is not None]
    if not found:
        return None
    k, vehicle = min(found, key=lambda each: float(each[1].time_s[each[0]]))
    x, y = float(vehicle.x_m[k]), float(vehicle.y_m[k])
    place = roadside_at(network, x, y, z_m=float(vehicle.z_m[k]))
    left_s, sides = left_road(network, vehicle, log.bodies[vehicle.number], float(vehicle.time_s[k]))
    speeds = np.hypot(vehicle.velocity_x_mps, vehicle.velocity_y_mps)
    return ObservedOverturn(
        time_s=float(vehicle.time_s[k]),
        xy_m=(x, y),
        place=place,
        along_m=along_road_m(network, x, y, place),
        left_s=left_s,
        sides=sides,
        initial_speed_mps=float(speeds[0]),
        speed_mps=float(speeds[k]),
        slid_m=math.hypot(float(vehicle.x_m[-1]) - x, float(vehicle.y_m[-1]) - y),
        quarter_turns=round(abs(float(vehicle.roll_rad[-1])) / (math.pi / 2)),
        street=departed_street(network, vehicle, float(vehicle.time_s[k]) if left_s is None else left_s),
    )


def overturn_criteria(
    observed: ObservedOverturn | None, record: CrashRecord, log: SimulationLog, settings: VerdictSettings
) -> tuple[Criterion, ...]:
    """Every criterion of the rule set, those that reject first, then those that are only shown.

    >>> (criterion,) = overturn_criteria(None, tree_record, judged_tree.log, VerdictSettings())
    >>> criterion.name, criterion.passed, criterion.reason.value
    ('overturn', False, 'no_overturn')
    """
    departure = departure_of(record)
    if departure is None:
        raise Failure(f"{record.key}: judged as an overturn, but its report tells of none; judge it again")
    vehicle, event = departure.vehicle, departure.event_number
    if observed is None:
        detail = f"vehicle {vehicle.number} does not overturn ({log.reason})"
        return (Criterion("overturn", 0.0, 1.0, "", False, Reason.NO_OVERTURN, detail, vehicle.number, event),)
    rules = RULE_SETS[settings.rule_set]
    limits = rules.limits or settings
    error = speed_error_rel(observed.initial_speed_mps, vehicle)
    return (
        Criterion("overturn", 1.0, 1.0, "", True, Reason.NO_OVERTURN, "", vehicle.number, event),
        *departing(observed.left_s, observed.sides, observed.place, departure, record, settings),
        street_criterion(observed.street, record, vehicle.number, event),
        at_most(
            "station_distance", observed.along_m, limits.max_contact_distance_m, "m", Reason.WRONG_LOCATION, None, event
        ),
        speed_criterion(error, rules, limits, vehicle.number, event),
        *(
            Criterion(
                "later_event",
                None,
                1.0,
                "",
                None,
                None,
                f"{event_named(each.number, each.code)}: not simulated",
                None,
                each.number,
            )
            for each in record.events
            if each.number > event
        ),
        shown("overturn_time", observed.time_s, "s", vehicle.number, event),
        shown("overturn_speed", observed.speed_mps, "mps", vehicle.number, event),
        shown("slide_distance", observed.slid_m, "m", vehicle.number, event),
        shown("quarter_turns", float(observed.quarter_turns), "", vehicle.number, event),
    )
