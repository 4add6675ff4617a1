"""Manoeuvres: the paths one vehicle can have taken along one approach.

An option is an approach, a manoeuvre and the path that results. Options that are possible anywhere along the road
(keeping the lane, crossing the centre line) can be moved along it to the place of the crash. Moving a turn at a
junction costs likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from trace_dag.common.geometry import Pose
from trace_dag.common.paths import LateralShift, Path, TurnShape, shifted, turn_start_to_meet, turned
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.crash_types import Turn
from trace_dag.crash.record import PreCrashMovement, VehicleRecord
from trace_dag.reconstruction.motion.speeds import (
    COMFORTABLE_LATERAL_MPS2,
    HARDEST_LATERAL_MPS2,
    as_on_the_right,
    least_turn_radius_m,
)
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.simulation.states import Manoeuvre

_TURN_RADIUS_M = {Turn.LEFT: 13.0, Turn.RIGHT: 9.0, Turn.U_TURN: 6.5}  # as drivers take ordinary street corners
_CREEPING_RADIUS_M, _RADIUS_TIME_S = 6.0, 1.2  # a vehicle that creeps turns the wheel further
_TURN_ANGLE_RAD = {Turn.LEFT: math.pi / 2, Turn.RIGHT: -math.pi / 2}
_WIDE_TURN_M = 25.0  # a larger radius does not fit a junction: the turn is then taken harder
_STEERING_TIME_S = 0.7  # to turn the wheel into a corner
_TAIL_M = 80.0

_TURN_MANOEUVRE = {Turn.LEFT: Manoeuvre.TURN_LEFT, Turn.RIGHT: Manoeuvre.TURN_RIGHT, Turn.U_TURN: Manoeuvre.U_TURN}
_OVERLAP_M = 1.2
_LEAST_SHAPE_SPEED_MPS = 7.0
# Moves sideways: lateral acceleration (g), how far beyond the other line (share), log-likelihood. In order: drifting
# over and driving on there, steering over, going on across, swerving.
_SHIFTS = ((0.05, 1.0, 0.0), (0.12, 1.0, 0.0), (0.1, 1.8, 0.0), (0.25, 1.0, -0.5))
CURVE_RAD = math.radians(8)


@dataclass(frozen=True, eq=False)
class Option:
    """One path of one vehicle. ``station_m`` is its nominal station at the crash, along the approach's own path.

    ``slides``: the manoeuvre may be anywhere along the road. ``costs`` are log-likelihoods of its unusual parts.
    """

    approach: Approach
    manoeuvre: Manoeuvre
    station_m: float
    slides: bool
    speed_mps: float
    constant_m: float = 0.0
    shift: LateralShift | None = None
    turn: TurnShape | None = None
    turn_start_m: float = 0.0
    earlier_m: float = 0.0  # how much earlier it turns than the lanes do; already in turn_start_m
    backing: bool = False
    costs: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Return a name that is unique among the options of the vehicle."""
        how = f" at {math.degrees(math.atan(self.shift.slope)):.1f} deg" if self.shift is not None else ""
        if self.constant_m:
            how += f" {abs(self.constant_m):.1f} m {'left' if self.constant_m > 0 else 'right'} of the lane's centre"
        if self.earlier_m:
            how += f" {abs(self.earlier_m):g} m {'early' if self.earlier_m > 0 else 'late'}"
        return f"{self.manoeuvre}{how} on {self.approach.name}"

    def path(self, slide_m: float = 0.0) -> Path:
        """Return the path, its manoeuvre moved ``slide_m`` along the approach."""
        base = self.approach.path
        if self.turn is not None:
            return turned(base, self.turn, start_s_m=self.turn_start_m + slide_m, tail_m=_TAIL_M)
        if self.shift is None and self.constant_m == 0.0:
            return base
        return shifted(base, self.shift, anchor_s_m=self.station_m + slide_m, constant_m=self.constant_m)

    def nominal_pose(self, slide_m: float) -> Pose:
        """Return the vehicle's pose at its nominal place at the crash."""
        return self.approach.path.pose(self.station_m + slide_m)


def keep_lane(
    approach: Approach, vehicle: VehicleRecord, speed_mps: float, *, offset_m: float = 0.0, turn: Turn | None = None
) -> Option:
    """Return the option of keeping the lane, ``offset_m`` left of its centre.

    The manoeuvre's name depends on the record and the road.

    ``turn`` is the turn that the lane itself makes, if the record calls it a turn.

    >>> keep_lane(scene.through[0], queue_record.vehicles[1], 0.0).manoeuvre.value  # P_CRASH1 5: stopped in the roadway
    'stopped'
    """
    approach = approach.fitted(speed_mps)
    if turn is not None and follows_turn(approach, turn):
        manoeuvre = _TURN_MANOEUVRE[turn]
    elif approach.wrong_way:
        manoeuvre = Manoeuvre.WRONG_WAY
    elif approach.road is not None and approach.road.inferred:
        manoeuvre = Manoeuvre.ENTER_FROM_DRIVEWAY
    elif speed_mps == 0.0 and vehicle.movement not in (PreCrashMovement.STARTING, PreCrashMovement.ACCELERATING):
        manoeuvre = Manoeuvre.STOPPED
    elif vehicle.movement is PreCrashMovement.STARTING:
        manoeuvre = Manoeuvre.STARTING
    elif vehicle.movement is PreCrashMovement.PASSING:
        manoeuvre = Manoeuvre.PASS
    elif vehicle.movement is PreCrashMovement.MERGING:
        manoeuvre = Manoeuvre.MERGE
    elif vehicle.movement is PreCrashMovement.NEGOTIATING_CURVE and abs(approach.curve_rad) > CURVE_RAD:
        manoeuvre = Manoeuvre.CURVE
    else:
        manoeuvre = Manoeuvre.STRAIGHT
    return Option(approach, manoeuvre, approach.station_m, True, speed_mps, constant_m=offset_m)


def back_up(approach: Approach, speed_mps: float) -> Option:
    """Return the option of backing along the approach: the path is the lane reversed, the body faces along the lane."""
    approach = approach.fitted(speed_mps)
    return Option(approach, Manoeuvre.BACKING, approach.station_m, True, speed_mps, backing=True)


def steepest_slope(total_m: float, speed_mps: float, lateral_mps2: float) -> float:
    """Return the steepest slope of a shift by ``total_m`` within the lateral acceleration, at most 40 degrees.

    Each ramp is as long as slope and acceleration demand, and both ramps fit into the shift.

    >>> steepest_slope(3.0, 20.0, 2.0)  # sqrt(3 * 2 / (1.5 * 20 ** 2))
    0.1
    """
    limit = math.tan(math.radians(40))
    return min(limit, math.sqrt(abs(total_m) * lateral_mps2 / (1.5 * speed_mps**2)))


def lateral_shift(
    total_m: float, speed_mps: float, slope: float, lateral_mps2: float, *, beyond_m: float = 0.0
) -> LateralShift:
    """Return a shift by ``total_m`` and ``beyond_m`` more, with ramps within the lateral acceleration.

    It is anchored where bodies on the two lines begin to overlap.

    >>> lateral_shift(3.0, 20.0, 0.1, 2.0).length_m  # 3 / 0.1, and ramps of 1.5 * 0.1 * 20 ** 2 / 2
    60.0
    """
    ramp_m = max(1.5 * slope * speed_mps**2 / lateral_mps2, 4.0)
    ramp_m = min(ramp_m, abs(total_m + beyond_m) / slope)
    short_of_m = min(_OVERLAP_M, abs(total_m) / 3)
    return LateralShift(total_m + beyond_m, math.copysign(abs(total_m) - short_of_m, total_m), slope, ramp_m)


def drift(total_m: float, speed_mps: float, lateral_g: float) -> LateralShift:
    """Return a shift that has reached ``total_m`` at its anchor, within a lateral acceleration (g).

    >>> drift(3.0, 20.0, 0.2).at_anchor_m
    3.0
    """
    shape_speed_mps, lateral = max(speed_mps, _LEAST_SHAPE_SPEED_MPS), lateral_g * GRAVITY_MPS2
    slope = steepest_slope(total_m, shape_speed_mps, lateral)
    return replace(lateral_shift(total_m, shape_speed_mps, slope, lateral), at_anchor_m=total_m)


def move_sideways(
    approach: Approach, speed_mps: float, total_m: float, manoeuvre: Manoeuvre, *, from_offset_m: float = 0.0
) -> list[Option]:
    """Return the manoeuvres that leave the lane by ``total_m`` to the left (negative: right), gently and hard."""
    options: list[Option] = []
    approach = approach.fitted(speed_mps)
    shape_speed_mps = max(speed_mps, _LEAST_SHAPE_SPEED_MPS)  # a vehicle that stands there came at some speed
    for lateral_g, share, cost in _SHIFTS:
        lateral = lateral_g * GRAVITY_MPS2
        slope = steepest_slope(share * total_m, shape_speed_mps, lateral)
        shift = lateral_shift(total_m, shape_speed_mps, slope, lateral, beyond_m=(share - 1.0) * total_m)
        if any(shift == option.shift for option in options):
            continue
        costs = {"abruptness": cost} if cost else {}
        options.append(
            Option(
                approach,
                manoeuvre,
                approach.station_m,
                True,
                speed_mps,
                constant_m=from_offset_m,
                shift=shift,
                costs=costs,
            )
        )
    return options


def follows_turn(approach: Approach, turn: Turn | None) -> bool:
    """Return whether the approach's own lanes make the turn.

    The corner of an L, or a bend that the record calls a turn.
    """
    if turn is None or approach.turn is not None:
        return False
    wanted = _turn_angle_rad(approach, turn)
    return approach.curve_rad * wanted > 0 and abs(approach.curve_rad) >= abs(wanted) / 2


def _turn_angle_rad(approach: Approach, turn: Turn) -> float:
    """Return the angle of a turn at a right-angled corner, or of a U-turn; counter-clockwise."""
    return -approach.kerb_sign * math.pi if turn is Turn.U_TURN else _TURN_ANGLE_RAD[turn]


def _turn_shape(turn: Turn, angle_rad: float, vehicle: VehicleRecord, speed_mps: float) -> TurnShape:
    """Return the turn of a vehicle at this speed: of the usual radius, wider if the speed requires it."""
    radius = max(
        min(_TURN_RADIUS_M[turn], _CREEPING_RADIUS_M + _RADIUS_TIME_S * speed_mps),
        least_turn_radius_m(vehicle.vehicle_class, vehicle.length_m),
        speed_mps**2 / COMFORTABLE_LATERAL_MPS2,
    )
    if radius > _WIDE_TURN_M:
        radius = max(_WIDE_TURN_M, speed_mps**2 / HARDEST_LATERAL_MPS2)
    ramp = min(max(_STEERING_TIME_S * speed_mps, 2.0), 0.8 * radius * abs(angle_rad))
    return TurnShape(angle_rad, radius, ramp)


def make_turn(
    approach: Approach, vehicle: VehicleRecord, speed_mps: float, turn: Turn, *, slides: bool
) -> list[Option]:
    """Return the turns off the approach: to the exit of its lanes, or else at a right angle at the place of the crash.

    Turns that begin earlier or later than the lanes' own are further options, at a cost.

    >>> approach = next(each for each in scene.approaches if each.turn is Turn.LEFT)
    >>> {each.manoeuvre.value for each in make_turn(approach, record.vehicles[0], 6.0, Turn.LEFT, slides=False)}
    {'turn_left'}
    """
    approach = approach.fitted(speed_mps)
    if approach.exit_pose is not None and approach.turn is turn:
        near = approach.turn_from_m
        angle = math.remainder(approach.exit_pose.heading_rad - approach.path.pose(near).heading_rad, math.tau)
        if turn is Turn.U_TURN:
            angle = _turn_angle_rad(approach, turn)
    else:
        near, angle = approach.station_m, _turn_angle_rad(approach, turn)
    shape = _turn_shape(as_on_the_right(turn, approach.road), angle, vehicle, speed_mps)
    start = None
    if approach.exit_pose is not None and approach.turn is turn:
        start = turn_start_to_meet(approach.path, shape, approach.exit_pose, near_s_m=near)
    costs = {}
    if start is None:
        start = approach.station_m - shape.displacement_m()[0]
        costs["no lanes for the turn"] = -1.0
    options = []
    for earlier in (0.0,) if slides else (0.0, 4.0, -4.0, 8.0):
        extra = {"turn begins early or late": -0.5 * (earlier / 4.0) ** 2} if earlier else {}
        options.append(
            Option(
                approach,
                _TURN_MANOEUVRE[turn],
                approach.station_m,
                slides,
                speed_mps,
                turn=shape,
                turn_start_m=start - earlier,
                earlier_m=earlier,
                costs={**costs, **extra},
            )
        )
    return options
