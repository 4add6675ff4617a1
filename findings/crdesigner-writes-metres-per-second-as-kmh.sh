#!/usr/bin/env bash
# Expected: CommonRoad states a limit in m/s (a sign 274 with `additionalValue` 13.8889 is one of 50 km/h), and OpenDRIVE has
#   the unit beside the value: converted, the signal has 50 km/h, or 13.8889 m/s.
# Happens: `commonroad_to_opendrive` writes the number as it is beside the unit km/h: a street of 50 km/h becomes one of
#   13.9 km/h. Lane and road have no `<speed>` either.
# Version: commonroad-scenario-designer 0.8.5 with commonroad-io 2024.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q commonroad-scenario-designer==0.8.5 commonroad-io==2024.3
cd "$folder"
cat > find.py <<'PY'
import logging
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.common.util import FileFormat
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from crdesigner.map_conversion.map_conversion_interface import commonroad_to_opendrive

logging.disable(logging.CRITICAL)
x_m = np.arange(0.0, 101.0, 5.0)
sides = [np.stack([x_m, np.full_like(x_m, y_m)], axis=1) for y_m in (1.75, 0.0, -1.75)]
limit = TrafficSignElement(TrafficSignIDGermany.MAX_SPEED, ["13.8889"])
scenario = Scenario(0.1, ScenarioID.from_benchmark_id("DEU_Road-1_1_T-1", "2020a"))
scenario.add_objects(Lanelet(*sides, 1, lanelet_type={LaneletType.URBAN}))
scenario.add_objects(TrafficSign(2, [limit], {1}, np.array([10.0, -2.5])), {1})
writer = CommonRoadFileWriter(
    scenario, PlanningProblemSet(), "author", "place", "source", set(), file_format=FileFormat.XML
)
writer.write_to_file("road.xml", OverwriteExistingFile.ALWAYS)
commonroad_to_opendrive(Path("road.xml"), Path("road.xodr"))
root = ElementTree.parse("road.xodr").getroot()
signals = [(each.get("type"), float(each.get("value")), each.get("unit")) for each in root.iter("signal")]
print(f"commonroad-scenario-designer {version('commonroad-scenario-designer')}, commonroad-io {version('commonroad-io')}")
print("limit of 13.8889 m/s = 50 km/h in CommonRoad; signals in OpenDRIVE:", signals)
print("elements <speed>:", len(list(root.iter("speed"))))
assert signals == [("274", 13.8889, "km/h")], signals
assert not list(root.iter("speed"))
print("the limit of 50 km/h became one of 13.9 km/h")
PY
venv/bin/python -W ignore find.py 2> /dev/null
