"""Crashes made by hand for the verdict's tests: a street and a crossroads, records, simulated hypotheses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tests.simulation.motions import CAR, log_of
from trace_dag.common.geometry import LocalFrame, Pose
from trace_dag.common.settings import SimSettings, VerdictSettings
from trace_dag.common.units import clock_to_bearing_rad
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, PreCrashMovement, VehicleClass, VehicleRecord
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import participants, simulate
from trace_dag.simulation.states import (
    EstimatorRun,
    Hypothesis,
    Manoeuvre,
    ParticipantState,
    SpeedSource,
    StateEstimate,
    Trajectory,
)
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.changed_plans import ChangedPlan, changed_estimate, changed_row
from trace_dag.verdict.controls import ControlRow, JudgedCrash

LANE_WIDTH_M = 3.5
FRAME = LocalFrame(37.0, -77.0)


def two_way(road_id: str, x_m: float, y_m: float, heading_rad: float, length_m: float) -> Road:
    """A straight two-lane road: lane -1 along its reference line, lane 1 against it."""
    return _straight_road((1, 0, -1), road_id, x_m, y_m, heading_rad, length_m)


def one_way(road_id: str, x_m: float, y_m: float, heading_rad: float, length_m: float) -> Road:
    """A straight road of one lane, right of its reference line and along it."""
    return _straight_road((0, -1), road_id, x_m, y_m, heading_rad, length_m)


def _straight_road(
    lane_ids: tuple[int, ...], road_id: str, x_m: float, y_m: float, heading_rad: float, length_m: float
) -> Road:
    lanes = tuple(
        Lane(i, LaneType.DRIVING, (Cubic(0.0, LANE_WIDTH_M),)) if i else Lane(0, LaneType.NONE, ()) for i in lane_ids
    )
    line = (PlanElement(0.0, x_m, y_m, heading_rad, length_m),)
    return Road(road_id, length_m, line, (LaneSection(0.0, lanes),))


STREET = RoadNetwork(FRAME, (two_way("1", -300.0, 0.0, 0.0, 600.0),))
CROSSROADS = RoadNetwork(FRAME, (two_way("1", -300.0, 0.0, 0.0, 600.0), two_way("2", 0.0, -300.0, math.pi / 2, 600.0)))


def area(clock_h: int) -> ImpactArea:
    """A clock position as reported."""
    return ImpactArea(clock_h, float(clock_h), clock_to_bearing_rad(clock_h), math.radians(15))


def vehicle(
    number: int,
    clock_h: int | None,
    crash_type: int | None = None,
    movement: PreCrashMovement = PreCrashMovement.GOING_STRAIGHT,
    speed_mps: float | None = None,
) -> VehicleRecord:
    """A car as reported."""
    return VehicleRecord(
        number,
        VehicleClass.CAR,
        CAR.length_m,
        CAR.width_m,
        CAR.height_m,
        CAR.mass_kg,
        travel_speed_mps=speed_mps,
        movement=movement,
        crash_type_code=crash_type,
        impact=area(clock_h) if clock_h is not None else None,
    )


def record(*vehicles: VehicleRecord, key: str = "2023-1", events: tuple[EventRecord, ...] | None = None) -> CrashRecord:
    """A two-vehicle crash at the origin."""
    first = EventRecord(1, 12, vehicles[0].number, vehicles[0].impact, vehicles[1].number, vehicles[1].impact)
    return CrashRecord(
        key=key,
        case_year=2023,
        state_case=1,
        latitude_deg=FRAME.latitude_deg,
        longitude_deg=FRAME.longitude_deg,
        vehicles=vehicles,
        events=events if events is not None else (first,),
        collision_type=CollisionType.FRONT_TO_FRONT,
        road_topology=RoadTopology.NOT_AN_INTERSECTION,
        vehicle_trajectory=VehicleTrajectory.OPPOSITE_DIRECTION,
    )


def state(number: int, trajectory: Trajectory, impact_time_s: float) -> ParticipantState:
    """A car that drives a trajectory."""

    def pose(time_s: float) -> Pose:
        x, y, heading = (
            float(np.interp(time_s, trajectory.time_s, values))
            for values in (trajectory.x_m, trajectory.y_m, trajectory.heading_rad)
        )
        return Pose(x, y, heading)

    return ParticipantState(
        vehicle_number=number,
        vehicle_class=CAR.vehicle_class,
        length_m=CAR.length_m,
        width_m=CAR.width_m,
        height_m=CAR.height_m,
        mass_kg=CAR.mass_kg,
        manoeuvre=Manoeuvre.STRAIGHT,
        initial_pose=pose(0.0),
        initial_speed_mps=float(trajectory.speed_mps[0]),
        impact_pose=pose(impact_time_s),
        impact_speed_mps=float(np.interp(impact_time_s, trajectory.time_s, trajectory.speed_mps)),
        speed_source=SpeedSource.REPORTED,
        trajectory=trajectory,
    )


def simulated(*trajectories: Trajectory, impact_time_s: float = 3.0) -> tuple[Hypothesis, SimulationLog]:
    """Vehicles 1, 2, ... on their trajectories, simulated on a dry plane."""
    hypothesis = Hypothesis(
        name="made by hand",
        score=0.0,
        evidence={},
        participants=tuple(state(i, t, impact_time_s) for i, t in enumerate(trajectories, start=1)),
        impact_time_s=impact_time_s,
        impact_point_xy_m=(0.0, 0.0),
    )
    return hypothesis, log_of(participants(hypothesis))


def estimate(*hypotheses: Hypothesis, key: str = "2023-1") -> StateEstimate:
    """Hypotheses in the order given."""
    return StateEstimate(key, hypotheses, EstimatorRun("by hand", "1"))


def moved(trajectory: Trajectory, dx_m: float, dy_m: float) -> Trajectory:
    """The same motion elsewhere."""
    return replace(trajectory, x_m=trajectory.x_m + dx_m, y_m=trajectory.y_m + dy_m)


def row_of_change(crash: JudgedCrash, name: str, changed: ChangedPlan | None) -> ControlRow:
    """The judgement of a changed plan, simulated; of none where nothing could be changed."""
    log = None
    if changed is not None:
        made = changed_estimate(crash, changed)
        (log,) = simulate(EmbeddedBackend(SimSettings()), crash.network, b"", made, SimSettings(), record=crash.record)
    return changed_row(crash, name, changed, log, VerdictSettings())


def acceptance_rate(rows: Sequence[ControlRow]) -> float | None:
    """Share accepted of the rows to which the control applies; None if there are none."""
    judged = [row.verified for row in rows if row.verified is not None]
    return sum(judged) / len(judged) if judged else None
