"""Learned distributions of unreported travel speeds, and of the loss of speed before the strike.

Travel speeds are learned from police reports in FARS, as differences from the rule of
:mod:`trace_dag.reconstruction.motion.speeds` (limit, manoeuvre, class of the road). The loss of speed before the impact
is learned from the last five seconds of event data recorders. ``lab/fit_speeds.py`` fits both and writes the tables in
:mod:`trace_dag.reconstruction.motion.speed_coefficients`; ``lab/mask_and_predict.py`` measures their quality.

A reported speed is taken as the speed before braking. For vehicles that go along the road the median reported speed is
the limit; in recorders that is the speed five seconds before the impact, and the speed at the impact is lower. For
vehicles that turn, reported speeds match those of recorders at the impact, and are taken as such.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from typing import Final

import numpy as np

from trace_dag.common.units import GRAVITY_MPS2, mph_to_mps
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.codes.elements import OVERTURN, RAN_OFF, RAN_OFF_AT_END, RAN_OFF_LEFT, RAN_OFF_RIGHT
from trace_dag.crash.crash_types import EncounterRole, Relation
from trace_dag.crash.record import HEAVY_VEHICLES, PreCrashMovement, Severity, VehicleClass
from trace_dag.crash.summary import is_dark
from trace_dag.reconstruction.motion.speed_coefficients import BRAKING, BRAKING_G, LEVELS, SHIFTS_MPH, SPREAD_MPH
from trace_dag.reconstruction.motion.speeds import (
    BRAKING_AVOIDANCE,
    STARTING_MPS2,
    STOP_CONTROLS,
    SpeedProfile,
    TravelSpeed,
    brakes,
    starts,
    travel_speed,
)
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.reconstruction.ranking import drawn
from trace_dag.roads.map.model import Road
from trace_dag.simulation.states import SpeedSource

NO_BRAKING: Final = frozenset({1, 5, 6, 7, 10, 11, 12})  # P_CRASH3: nothing was done, or something else than braking
_SIGNALS: Final = frozenset({1, 2, 3, 4})  # VTRAFCON
_DRY: Final = 1  # VSURCOND
_RURAL: Final = 1  # RUR_URB
_FREEWAYS: Final = frozenset({1, 2})  # FUNC_SYS
_CLEAR: Final = frozenset({None, 1, 10})  # WEATHER: clear, cloudy
_LOW_LIMIT_MPS: Final = mph_to_mps(32)
_STARTING_TIME_S: Final = 3.0
_LONGEST_BRAKING_S: Final = 4.0  # before that a driver of a reported speed had it: recorders have five seconds
_LEAST_KEPT: Final = 0.25  # share of the speed: who has nearly stopped kills nobody
_FASTEST_MPS: Final = mph_to_mps(151)  # the highest TRAV_SP
_STEPS: Final = 1000  # of a distribution that is weighted
_DEATH_POWER: Final = 1.5
"""Power of the speed with which deaths among serious injuries grow: of 3.5 for fatal crashes, 2.0 for crashes with
serious injuries, of which the recorders are (Elvik, The Power Model of the relationship between speed and road safety,
TOI report 1034, 2009)."""


class SpeedClass(StrEnum):
    """A class of vehicles with the same spread of speeds."""

    STANDING = "standing"  # the report says that it stood
    SLOW = "slow"  # turning, backing, from a stop sign
    SPEEDING = "speeding"
    ALONG = "along"


class Role(StrEnum):
    """Roles of a vehicle in a crash, as far as they matter for braking."""

    TURNING = "turning"
    OPPOSITE = "opposite"
    CROSSING = "crossing"
    ALONE = "alone"
    BEHIND = "behind"
    AHEAD = "ahead"
    OTHER = "other"


@dataclass(frozen=True)
class Distribution:
    """Values (m/s, or a ratio) at the cumulative probabilities :data:`LEVELS`."""

    values: tuple[float, ...]

    def at(self, probability: float) -> float:
        """Return the value at a cumulative probability, linear between the levels."""
        return float(np.interp(probability, LEVELS, self.values))

    def probability_below(self, value: float) -> float:
        """Return the cumulative probability of a value, linear between the levels."""
        return float(np.interp(value, self.values, LEVELS))

    @cache  # noqa: B019 - there are as many as rows of the table
    def weighted(self, power: float) -> Distribution:
        """Return the distribution of those that are counted by a power of their value.

        >>> round(Distribution(LEVELS).weighted(1.0).at(0.25), 2)  # of 0 to 1, evenly: its square is the probability
        0.5
        """
        values = np.interp((np.arange(_STEPS) + 0.5) / _STEPS, LEVELS, self.values)
        counted = np.cumsum(values**power)
        return Distribution(tuple(np.interp(LEVELS, counted / counted[-1], values).tolist()))

    @property
    def median(self) -> float:
        """Return the median."""
        return self.at(0.5)


def speed_class(party: Party, rule: TravelSpeed) -> SpeedClass:
    """Return the speed class of a vehicle; ``rule`` is the speed from its manoeuvre, limit or road.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> rule = TravelSpeed(0.0, SpeedSource.INFERRED_MANOEUVRE)
    >>> speed_class(party(queue_record, queue_record.vehicles[1]), rule).value
    'standing'
    """
    if rule.source is SpeedSource.INFERRED_MANOEUVRE:
        return SpeedClass.STANDING if rule.speed_mps == 0.0 else SpeedClass.SLOW
    return SpeedClass.SPEEDING if party.vehicle.speeding else SpeedClass.ALONG


def role(party: Party) -> Role:
    """Return a vehicle's role by its record.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> [role(party(queue_record, vehicle)).value for vehicle in queue_record.vehicles[:2]]  # crash types 20 and 21
    ['behind', 'ahead']
    """
    kind = party.crash_type
    if party.turn is not None:
        return Role.TURNING
    if kind.relation is Relation.SAME_LANE:
        return Role.BEHIND if kind.role is EncounterRole.STRIKING else Role.AHEAD
    by_relation = {Relation.OPPOSITE_DIRECTION: Role.OPPOSITE, Relation.CROSSING: Role.CROSSING}
    if kind.relation in by_relation:
        return by_relation[kind.relation]
    left_road = bool(party.events & {RAN_OFF_RIGHT, RAN_OFF_LEFT, RAN_OFF_AT_END, RAN_OFF})
    return Role.ALONE if kind.single_driver or left_road else Role.OTHER


def features(party: Party, rule: TravelSpeed) -> dict[str, bool]:
    """Return the reported facts, beside the rule, that affect a travel speed.

    Their names are those of the table of shifts.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> rider = party(record, record.vehicles[1])
    >>> found = features(rider, TravelSpeed(13.4, SpeedSource.INFERRED_LIMIT))
    >>> found["motorcycle"], found["speeding"]
    (True, False)
    """
    record, vehicle, relation = party.record, party.vehicle, party.crash_type.relation
    along = speed_class(party, rule) in (SpeedClass.SPEEDING, SpeedClass.ALONG)
    slow = speed_class(party, rule) is SpeedClass.SLOW
    of_those_along = {
        "speeding": bool(vehicle.speeding),
        "speeding not coded": vehicle.speeding is None,
        "driver had drunk": bool(vehicle.driver_drinking),
        "left the road alone": party.crash_type.single_driver
        and not record.non_motorists
        and record.kind is not CrashKind.ANIMAL,
        "a person was struck": bool(record.non_motorists),
        "curve": vehicle.movement is PreCrashMovement.NEGOTIATING_CURVE,
        "slowing": vehicle.movement is PreCrashMovement.DECELERATING,
        "braked": vehicle.avoidance_code in BRAKING_AVOIDANCE,
        "struck from behind": role(party) is Role.AHEAD,
        "ran into one ahead": role(party) is Role.BEHIND,
        "crossing": relation is Relation.CROSSING,
        "opposite direction": relation is Relation.OPPOSITE_DIRECTION,
        "motorcycle": vehicle.vehicle_class is VehicleClass.MOTORCYCLE,
        "truck or bus": vehicle.vehicle_class in HEAVY_VEHICLES,
        "surface not dry": vehicle.surface_condition_code not in (None, _DRY),
        "rain, snow or fog": record.weather_code not in _CLEAR,
        "dark": is_dark(record),
        "rural": record.rural_urban_code == _RURAL,
        "freeway": record.function_class_code in _FREEWAYS,
        "signal": vehicle.traffic_control_code in _SIGNALS,
        "limit of 30 mph or less": vehicle.speed_limit_mps is not None and vehicle.speed_limit_mps < _LOW_LIMIT_MPS,
    }
    of_slow_ones = {
        "turning": party.turn is not None,
        "from a stop sign": party.turn is None and vehicle.traffic_control_code in STOP_CONTROLS,
    }
    return {
        "going along": along,
        **{name: along and holds for name, holds in of_those_along.items()},
        **{name: slow and holds for name, holds in of_slow_ones.items()},
    }


def likely_travel_speed(party: Party, road: Road | None, *, crossing: bool) -> TravelSpeed:
    """Return the reported travel speed, or the median of its distribution.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> likely_travel_speed(party(queue_record, queue_record.vehicles[1]), None, crossing=False).speed_mps  # it stood
    0.0
    """
    rule = travel_speed(party.vehicle, party.crash_type, party.turn, road, crossing=crossing)
    if rule.source is SpeedSource.REPORTED:
        return rule
    return replace(rule, speed_mps=travel_speed_distribution(party, rule).median)


def travel_speed_distribution(party: Party, rule: TravelSpeed) -> Distribution:
    """Return the distribution of a vehicle's unreported travel speed (m/s)."""
    group = speed_class(party, rule)
    shift = math.fsum(SHIFTS_MPH[name] for name, holds in features(party, rule).items() if holds)
    return Distribution(
        tuple(min(max(rule.speed_mps + mph_to_mps(shift + spread), 0.0), _FASTEST_MPS) for spread in SPREAD_MPH[group])
    )


def speed_kept_distribution(party: Party) -> Distribution:
    """Return the distribution of the speed at the impact as a share of the travel speed.

    It is 1 if the report has no avoidance or one other than braking, and for vehicles that turn or stand. If somebody
    died, faster impacts count more.
    """
    whole = Distribution((1.0,) * len(LEVELS))
    if party.turn is not None or party.stationary or party.vehicle.avoidance_code in NO_BRAKING:
        return whole
    kept, died = Distribution(BRAKING[role(party)]), party.record.severity is Severity.KILLED
    return kept.weighted(_DEATH_POWER) if died and role(party) is not Role.AHEAD else kept


def speed_profile(party: Party, initial_mps: float, *, most_g: float = math.inf) -> SpeedProfile:
    """Return the speed of a vehicle up to the impact, with a start from rest if that is reported.

    Otherwise the loss of speed is drawn from :func:`speed_kept_distribution` for its role, and the deceleration from
    those of recorders. If braking is reported, the draw is limited to losses above 0.

    A crash always has the same draw. ``most_g`` is the limit of the ground (g).

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> speed_profile(party(record, record.vehicles[0]), 6.7)  # who turns keeps its speed
    SpeedProfile(initial_mps=6.7, impact_mps=6.7, change_time_s=0.0)
    >>> behind = party(queue_record, queue_record.vehicles[0])  # who runs into another
    >>> speed_profile(behind, 20.0) == speed_profile(behind, 20.0), speed_profile(behind, 20.0).impact_mps <= 20.0
    (True, True)
    """
    if starts(party.vehicle, initial_mps):
        return SpeedProfile(0.0, STARTING_MPS2 * _STARTING_TIME_S, _STARTING_TIME_S)
    kept, key, number = speed_kept_distribution(party), party.record.key, party.vehicle.number
    probability = drawn(key, f"braking of vehicle {number}")
    if OVERTURN in party.events:  # who goes over had more speed left than most
        probability = (1.0 + probability) / 2
    if brakes(party.vehicle) and party.turn is None:
        probability *= kept.probability_below(1.0)
    lost_mps = (1.0 - min(max(kept.at(probability), _LEAST_KEPT), 1.0)) * initial_mps
    usual_g = Distribution(BRAKING_G).at(drawn(key, f"deceleration of vehicle {number}"))
    lost_mps = min(lost_mps, most_g * GRAVITY_MPS2 * _LONGEST_BRAKING_S)
    hard_mps2 = max(min(usual_g, most_g) * GRAVITY_MPS2, lost_mps / _LONGEST_BRAKING_S)
    return SpeedProfile(initial_mps, initial_mps - lost_mps, lost_mps / hard_mps2)


def quantiles(values: Sequence[float]) -> tuple[float, ...]:
    """Return a sample's values at :data:`LEVELS`."""
    return tuple(float(value) for value in np.quantile(values, LEVELS))
