#!/usr/bin/env bash
# Expected: the documentation of commonroad-io's TrafficSign: "virtual" says whether a sign stands in the real
#   environment or was only added for completeness. A scenario that was written and read has the same sign.
# Happens: the writer puts <virtual>true</virtual> into the XML file, and the reader, which looks for an attribute
#   where the writer makes an element, says False: each inferred sign comes back as one that stands at the road.
#   The protobuf file of the same scenario keeps the value.
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
from commonroad.common.util import FileFormat
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDUsa

x, zero = np.array([0.0, 50.0, 100.0]), np.zeros(3)
scenario = Scenario(0.1, ScenarioID.from_benchmark_id("USA_Street-1_1_T-1", "2020a"))
scenario.tags = set()
scenario.add_objects(Lanelet(np.c_[x, zero + 1.75], np.c_[x, zero], np.c_[x, zero - 1.75], 1))
limit = TrafficSignElement(TrafficSignIDUsa.MAX_SPEED, ["15.0"])
scenario.add_objects(TrafficSign(2, [limit], {1}, np.array([0.0, -3.0]), virtual=True), {1})


def read_back(path, file_format):
    writer = CommonRoadFileWriter(scenario, PlanningProblemSet(), "A", "B", "C", set(), file_format=file_format)
    writer.write_to_file(path, OverwriteExistingFile.ALWAYS)
    read, _ = CommonRoadFileReader(path).open()
    return read.lanelet_network.traffic_signs[0].virtual


in_xml, in_protobuf = read_back("street.xml", FileFormat.XML), read_back("street.pb", FileFormat.PROTOBUF)
with open("street.xml") as file:
    written = [line.strip() for line in file if "virtual" in line]
print("commonroad-io", version("commonroad-io"))
print("virtual in the scenario: True; in the XML file:", written)
print("virtual as read from XML:", in_xml, " from protobuf:", in_protobuf)
assert written == ["<virtual>true</virtual>"]
assert in_xml is False and in_protobuf is True
print("a virtual sign is a real one after one turn through XML")
PY
venv/bin/python -W ignore find.py
