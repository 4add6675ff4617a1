#!/usr/bin/env bash
# Expected: CommonRoadFileWriter documents decimal_precision as the number of decimal places of the floats that it
#   writes, which rounds to the nearest, as str.format and numpy.round do.
# Happens: the XML writer cuts the digits off. Each value moves towards zero, by up to a whole last place: with two
#   decimals a vehicle at x 0.999 m and y -0.999 m comes back at 0.99 m and -0.99 m. Numbers below
#   0.0001, which Python writes with an exponent, are rounded.
# Version: commonroad-io 2024.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q commonroad-io==2024.3
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.geometry.shape import Rectangle
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import InitialState

x, zero = np.array([0.0, 50.0, 100.0]), np.zeros(3)
scenario = Scenario(0.1, ScenarioID.from_benchmark_id("USA_Street-1_1_T-1", "2020a"))
scenario.add_objects(Lanelet(np.c_[x, zero + 1.75], np.c_[x, zero], np.c_[x, zero - 1.75], 1))
state = InitialState(position=np.array([0.999, -0.999]), orientation=0.00006, velocity=13.999, time_step=0)
scenario.add_objects(StaticObstacle(2, ObstacleType.PARKED_VEHICLE, Rectangle(4.5, 1.8), state))


def read_back(decimals):
    writer = CommonRoadFileWriter(
        scenario, PlanningProblemSet(), "A", "B", "C", set(), decimal_precision=decimals
    )
    writer.write_to_file("street.xml", OverwriteExistingFile.ALWAYS)
    read, _ = CommonRoadFileReader("street.xml").open()
    state = read.static_obstacles[0].initial_state
    return [*state.position.tolist(), state.velocity, state.orientation]


print("commonroad-io", version("commonroad-io"))
print("written:              x 0.999, y -0.999, velocity 13.999, orientation 0.00006")
print("read at two decimals: ", two := read_back(2), "by rounding: [1.0, -1.0, 14.0, 0.0]")
print("read at four decimals:", four := read_back(4), "by rounding: [0.999, -0.999, 13.999, 0.0001]")
assert two[:3] == [0.99, -0.99, 13.99]
assert four == [0.999, -0.999, 13.999, 0.0001]
print("values move towards zero instead of to the nearest")
PY
venv/bin/python -W ignore find.py
