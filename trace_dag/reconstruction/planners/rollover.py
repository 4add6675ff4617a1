"""Overturns of vehicles, as first events before any contact, or later in the course.

The vehicle leaves its lane as for the strike of an object, out of control and turned across its course. Beyond the
edge, or on the roadway if the report places the overturn there, it moves without control. The overturn itself is
physics: it is simulated, with the usual settings, and the whole motion is moved along the road until the overturn is at
the reported place. A motorcycle falls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.common.settings import StateSettings
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import VehicleClass
from trace_dag.crash.road_departure import Departure, departure_of
from trace_dag.reconstruction.assemble import Drive, drive_along, planned_hypothesis
from trace_dag.reconstruction.course import DEFAULTS, Course, Plan, Search
from trace_dag.reconstruction.motion.departure_paths import (
    SIGN,
    add_skid,
    edge_near,
    lane_path,
    path_aside,
    skid_profile,
    slope_of,
)
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.speeds import TravelSpeed
from trace_dag.reconstruction.planners.way_after import STRIKES_MPS, ways_on
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.ranking import Scored
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.simulation.run import participants
from trace_dag.simulation.states import (
    Hypothesis,
    LossOfControl,
    Manoeuvre,
    ParticipantState,
    SpeedSource,
    Trajectory,
)
from trace_dag.simulation.types import Simulation, overturned_at

_BEYOND_EDGE_M: Final = 1.5  # the middle of the vehicle, when nobody holds it any more
_MOTORCYCLE_BEYOND_M: Final = 0.3
_SLIP_RAD: Final = math.radians(80)
_CLOCKWISE: Final = 3  # PCRASH4
_LATERAL_G: Final = ((0.35, 0.0), (0.2, -0.3))  # of the departure, and its log-likelihood
_MOVES: Final = 4  # of the motion along the road
_NEAR_M: Final = 0.5
_WAYS: Final = 4  # that are simulated
_AFTER_OVERTURN_S: Final = 0.1  # what comes later is not looked at here
_STAYS: Final = "stays on its wheels"
_STAYS_UP: Final = -5.0  # log-likelihood of a motion that does not overturn
_TRIPPED: Final = -0.3  # log-likelihood of wheels that dig in where no soil holds them
_FASTER: Final = ((1.15, -0.3), (1.3, -0.7))  # times the usual speed, and its log-likelihood


@dataclass(frozen=True, eq=False)
class _Way(Scored):
    """One way to the overturn: the lane path before it, and the manner of leaving it."""

    departure: Departure
    who: Party
    option: Option
    base: Path
    speed: TravelSpeed
    lateral_mps2: float
    slip_rad: float
    terms: dict[str, float]
    tripped: bool = False

    @property
    def name(self) -> str:
        """Return a name that is unique among the ways of the crash."""
        where = f"leaves {self.option.approach.name} {self.departure.side}" if self.departure.side else "overturns on"
        turned = "falls" if not self.slip_rad else "turned clockwise" if self.slip_rad < 0 else "turned anticlockwise"
        where = where if self.departure.side else f"{where} {self.option.approach.name}"
        return f"vehicle {self.who.vehicle.number}: {where} at {self.lateral_mps2 / GRAVITY_MPS2:.2f} g, {turned}"


def overturn_hypotheses(search: Search, settings: StateSettings) -> tuple[Hypothesis, ...]:
    """Return at most ``most`` ranked hypotheses of a vehicle that overturns before it touches anything.

    Raises :class:`Rejection` (``no_feasible_state``) if no path past the place leads off the road as reported.
    """
    scene = search.scene
    departure = departure_of(scene.record, search.sequence)
    ways = sorted(_ways(scene, departure), key=lambda way: (-way.score, way.name))[:_WAYS]
    if not ways:
        detail = scene.no_way_that("the vehicle can have come along")
        raise Rejection(Reason.NO_FEASIBLE_STATE, detail, measured=len(scene.approaches))
    found: list[Hypothesis] = []
    for way in ways:
        if len(found) == settings.max_hypotheses and way.score < found[-1].score:
            break  # simulated it would be no likelier than before
        found.append(_fast_enough(scene, way, search.simulation, settings.lead_time_s))
        found = sorted(found, key=lambda each: (-each.score, each.name))[: settings.max_hypotheses]
    return tuple(found)


def _ways(scene: Scene, departure: Departure) -> Iterator[_Way]:
    who = party(scene.record, departure.vehicle)
    for option, speed, terms in approaches_of(scene, who):
        if option.backing or speed.speed_mps < 1.0:
            continue
        base = lane_path(scene, option)
        for slip_rad in _slips(departure):
            for lateral_g, prior in _LATERAL_G if departure.side else _LATERAL_G[:1]:
                way_terms = terms | {"manner of leaving": prior}
                yield _Way(departure, who, option, base, speed, lateral_g * GRAVITY_MPS2, slip_rad, way_terms)


def _slips(departure: Departure) -> tuple[float, ...]:
    """Return the slip angles of the vehicle.

    They are those of ``PCRASH4``, or else point the front back to the road after oversteering; a motorcycle has none.
    """
    vehicle = departure.vehicle
    if vehicle.vehicle_class is VehicleClass.MOTORCYCLE:
        return (0.0,)
    if vehicle.stability_code == _CLOCKWISE:
        return (-_SLIP_RAD,)
    back = 1.0 if departure.side is DepartureSide.RIGHT else -1.0  # turned back towards the road
    return (back * _SLIP_RAD,)


def _fast_enough(scene: Scene, way: _Way, simulation: Simulation, lead_s: float) -> Hypothesis:
    """Return the hypothesis of a way, tripped by wheels that dig in if it would not overturn otherwise.

    An unreported speed may then be raised to that of one driver in twenty.
    """
    slowest = _placed(scene, way, simulation, lead_s)
    if _STAYS not in slowest.evidence:
        return slowest
    factors = ((1.0, 0.0),) if way.speed.source is SpeedSource.REPORTED else ((1.0, 0.0), *_FASTER)
    for factor, prior in factors:
        speed = way.speed
        if factor > 1.0:
            speed = TravelSpeed(way.speed.speed_mps * factor, SpeedSource.INFERRED_MANOEUVRE)
        terms = way.terms | {"tripped": _TRIPPED} | ({"faster than usual": prior} if prior else {})
        made = _placed(scene, replace(way, speed=speed, terms=terms, tripped=True), simulation, lead_s)
        if _STAYS not in made.evidence:
            return made
    return slowest


def _placed(scene: Scene, way: _Way, simulation: Simulation, lead_s: float) -> Hypothesis:
    """Return the hypothesis of a way, moved along the road until its overturn is at the reported station."""
    place_m, _ = way.base.project(*scene.place_xy_m)
    station_m = place_m
    best: tuple[float, Hypothesis] | None = None
    for _ in range(_MOVES):
        made, along = _hypothesis(scene, way, station_m, lead_s)
        log = simulation.run(participants(made), time_limit_s=DEFAULTS.time_limit_s, after_contact_s=_AFTER_OVERTURN_S)
        vehicle = log.vehicles[0]
        over = overturned_at(vehicle)
        if over is None:
            terms = made.evidence | {_STAYS: _STAYS_UP}
            return best[1] if best else replace(made, score=round(made.score + _STAYS_UP, 6), evidence=terms)
        at = np.array([vehicle.x_m[over], vehicle.y_m[over]])
        beyond_m = float((at - np.array(scene.place_xy_m)) @ along)
        made = replace(made, impact_point_xy_m=(round(float(at[0]), 6), round(float(at[1]), 6)))
        if best is None or abs(beyond_m) < abs(best[0]):
            best = beyond_m, made
        if abs(beyond_m) < _NEAR_M:
            break
        station_m -= beyond_m
    assert best is not None
    return best[1]


def _hypothesis(scene: Scene, way: _Way, station_m: float, lead_s: float) -> tuple[Hypothesis, FloatArray]:
    """Return the motion up to the loss of control at a station, and the road's direction there."""
    departure = way.departure
    profile = skid_profile(way.who, way.speed.speed_mps, way.slip_rad)
    option, path, at_m = way.option, way.base, station_m
    if departure.side is not None and departure.side is not DepartureSide.AHEAD:
        sign = SIGN[departure.side]
        at_m, edge = edge_near(scene, way.base, station_m, sign)
        off_m = edge + (_MOTORCYCLE_BEYOND_M if not way.slip_rad else _BEYOND_EDGE_M)
        slope = slope_of(off_m, way.lateral_mps2, profile.impact_mps)
        path, at_m = path_aside(way.base, at_m, sign * off_m, slope, way.lateral_mps2, profile.impact_mps)
        option = replace(option, manoeuvre=Manoeuvre.LEAVE_ROAD)
    drive = Drive(way.who, option, path, at_m, way.speed, profile)
    state = drive_along(scene.network, drive, lead_time_s=lead_s, after_s=0.0)
    state = add_skid(state, way.slip_rad, lead_s)
    if not way.slip_rad:
        state = replace(state, skids_from_s=round(lead_s, 6))
    if way.tripped:
        state = replace(state, losses_of_control=(LossOfControl(round(lead_s, 6), digs_in=True),))
    heading = way.base.pose(station_m).heading_rad
    hypothesis = planned_hypothesis(way, [_until(state, lead_s)], lead_s, state.impact_pose.xy_m)
    return hypothesis, np.array([math.cos(heading), math.sin(heading)])


def _until(state: ParticipantState, lead_s: float) -> ParticipantState:
    """Return the state with its plan up to the loss of control."""
    t = state.trajectory
    kept = t.time_s <= lead_s + 1e-9
    columns = (t.time_s, t.x_m, t.y_m, t.z_m, t.heading_rad, t.speed_mps)
    return replace(state, trajectory=Trajectory(*(values[kept] for values in columns)))


# --- later -----------------------------------------------------------------------------------------------------------
def later_overturn_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield the possible paths of a vehicle after its last event on which it may overturn."""
    number = event.vehicle.number
    if course.last_event_s(number) is None:
        yield f"vehicle {number} meets nobody before it"
        return
    for on_its_way, assumed in ways_on(search, course, number, event.side, tripped=True, least_mps=STRIKES_MPS):
        if overturned_at(on_its_way.log.vehicle_log(number)) is not None:
            yield Plan(on_its_way.states, on_its_way.objects, detail=f"overturns{assumed}")
