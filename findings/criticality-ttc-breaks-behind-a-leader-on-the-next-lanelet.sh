#!/usr/bin/env bash
# Expected: a CommonRoad road is a chain of lanelets, and it is no difference to a time to collision at which place the chain
#   is cut: behind a leader 120 m ahead that drives 10 m/s slower it is (120 m - one car) / 10 m/s.
# Happens: with the road as one lanelet the measure is 11.55 s. With a cut between both cars the headway is still right, and
#   the time to collision raises: the leader's direction is looked up on the follower's lanelet, and beyond some 20 m past its
#   end there is none. Nearer to its end the measure is right.
# Version: commonroad-crime 0.4.5 with commonroad-io 2024.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q commonroad-crime==0.4.5 commonroad-io==2024.3
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import HW, TTC


def lanelet(number, begin_m, end_m, before=(), after=()):
    x_m = np.arange(begin_m, end_m + 1, 2.0)
    left, middle, right = (np.stack([x_m, np.full_like(x_m, y_m)], axis=1) for y_m in (1.75, 0.0, -1.75))
    return Lanelet(left, middle, right, number, list(before), list(after), lanelet_type={LaneletType.URBAN})


def car(number, x_m, speed):
    first = InitialState(
        time_step=0, position=np.array([x_m, 0.0]), orientation=0.0, velocity=speed, acceleration=0.0, yaw_rate=0.0,
        slip_angle=0.0,
    )
    states = [
        KSState(time_step=k, position=np.array([x_m + 0.1 * k * speed, 0.0]), orientation=0.0, velocity=speed, steering_angle=0.0)
        for k in range(1, 60)
    ]
    shape = Rectangle(4.5, 1.8)
    return DynamicObstacle(number, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(1, states), shape))


def headway_and_ttc(road, leader_m):
    scenario = Scenario(0.1, ScenarioID.from_benchmark_id("ZAM_Road-1_1_T-1", "2020a"))
    for each in road:
        scenario.add_objects(each)
    scenario.add_objects([car(41, 20.0, 20.0), car(42, leader_m, 10.0)])
    scenario.assign_obstacles_to_lanelets()
    configuration = CriMeConfiguration()
    configuration.update(ego_id=41, sce=scenario)
    found = []
    for measure in (HW, TTC):
        try:
            found.append(float(measure(configuration).compute(42, 0, verbose=False)))
        except Exception as error:
            found.append(f"{type(error).__name__}: {error}")
    return found


def one():
    return [lanelet(1, 0, 200)]


def two():
    return [lanelet(1, 0, 100, after=[2]), lanelet(2, 100, 200, before=[1])]


print("commonroad-crime", version("commonroad-crime"), "with commonroad-io", version("commonroad-io"))
print("leader at 140 m, one lanelet:          ", headway_and_ttc(one(), 140.0))
print("leader at 110 m, lanelets cut at 100 m:", headway_and_ttc(two(), 110.0))
print("leader at 140 m, lanelets cut at 100 m:", headway_and_ttc(two(), 140.0))
assert headway_and_ttc(one(), 140.0) == [115.5, 11.55]
assert headway_and_ttc(two(), 110.0) == [85.5, 8.55]
assert headway_and_ttc(two(), 140.0) == [115.5, "TypeError: must be real number, not NoneType"]
print("no time to collision behind a leader more than 20 m into the next lanelet")
PY
venv/bin/python -W ignore find.py 2> /dev/null
