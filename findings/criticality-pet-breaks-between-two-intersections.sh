#!/usr/bin/env bash
# Expected: a post-encroachment time is a matter of two paths that cross. In CommonRoad a crossing may be one intersection
#   element with two incoming roads, or two elements that overlap, as where a ramp crosses a street just beside a junction.
#   Both are valid, and the time between the two vehicles is the same.
# Happens: with one element the measure is 0.5 s; with two it raises a KeyError, since the incoming road of one vehicle is
#   looked up in the element of the other.
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
from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID, Tag
from commonroad.scenario.state import InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import PET


def lanelet(number, begin, end, before=(), after=(), inside=False):
    begin, end = np.array(begin, float), np.array(end, float)
    middle = np.linspace(begin, end, 11)
    left = np.array([-(end - begin)[1], (end - begin)[0]]) / np.hypot(*(end - begin)) * 1.75
    kind = {LaneletType.INTERSECTION} if inside else {LaneletType.URBAN}
    return Lanelet(
        middle + left, middle, middle - left, number, list(before), list(after), lanelet_type=kind
    )


def car(number, start, heading, speed=10.0):
    way = np.array([np.cos(heading), np.sin(heading)]) * speed * 0.1
    places = [np.array(start, float) + k * way for k in range(90)]
    first = InitialState(
        time_step=0, position=places[0], orientation=heading, velocity=speed, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0
    )
    states = [
        KSState(time_step=k, position=places[k], orientation=heading, velocity=speed, steering_angle=0.0)
        for k in range(1, 90)
    ]
    shape = Rectangle(4.5, 1.8)
    return DynamicObstacle(number, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(1, states), shape))


def post_encroachment_time(elements):
    scenario = Scenario(0.1, ScenarioID.from_benchmark_id("ZAM_Crossing-1_1_T-1", "2020a"))
    scenario.tags = {Tag.INTERSECTION}
    scenario.add_objects(lanelet(1, (-60, 0), (-5, 0), after=[11]))
    scenario.add_objects(lanelet(11, (-5, 0), (5, 0), before=[1], after=[3], inside=True))
    scenario.add_objects(lanelet(3, (5, 0), (60, 0), before=[11]))
    scenario.add_objects(lanelet(2, (0, -60), (0, -5), after=[12]))
    scenario.add_objects(lanelet(12, (0, -5), (0, 5), before=[2], after=[4], inside=True))
    scenario.add_objects(lanelet(4, (0, 5), (0, 60), before=[12]))
    roads = {
        "west": IntersectionIncomingElement(21, {1}, successors_straight={11}),
        "south": IntersectionIncomingElement(22, {2}, successors_straight={12}),
    }
    for number, names in enumerate(elements, 31):
        scenario.add_objects(Intersection(number, [roads[name] for name in names]))
    scenario.add_objects([car(41, (-40, 0), 0.0), car(42, (0, -25), np.pi / 2)])
    scenario.assign_obstacles_to_lanelets()
    configuration = CriMeConfiguration()
    configuration.update(ego_id=41, sce=scenario)
    try:
        return PET(configuration).compute(42, 0, verbose=False)
    except KeyError as error:
        return f"KeyError: {error}"


print("commonroad-crime", version("commonroad-crime"), "with commonroad-io", version("commonroad-io"))
one = post_encroachment_time([("west", "south")])
two = post_encroachment_time([("west",), ("south",)])
print("one intersection element with both roads:", one)
print("two elements, a road in each:", two)
assert one == 0.5
assert two == "KeyError: 2"
print("the same crossing has no post-encroachment time where its roads belong to two elements")
PY
venv/bin/python -W ignore find.py 2> /dev/null
