#!/usr/bin/env bash
# Expected: `CommonRoadFileWriter(scenario, problems, ...).write_to_file(name)` writes the file `name`, or raises. In version
#   2024.3 it does so in both formats.
# Happens: in version 2026.1 the default format is the one of protobuf, and its `write_to_file` is an empty function: it
#   returns without a file, an error or a word. With `file_format=FileFormat.XML` the file is written.
# Version: commonroad-io 2026.1 and 2024.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version
from pathlib import Path

import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.common.util import FileFormat
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.scenario import Scenario, ScenarioID

x_m = np.arange(0.0, 101.0, 10.0)
sides = [np.stack([x_m, np.full_like(x_m, y_m)], axis=1) for y_m in (1.75, 0.0, -1.75)]
scenario = Scenario(0.1, ScenarioID.from_benchmark_id("ZAM_Road-1_1_T-1", "2020a"))
scenario.add_objects(Lanelet(*sides, 1, lanelet_type={LaneletType.URBAN}))
written = {}
for name, options in (("default", {}), ("xml", {"file_format": FileFormat.XML})):
    writer = CommonRoadFileWriter(scenario, PlanningProblemSet(), "author", "place", "source", set(), **options)
    returned = writer.write_to_file(name, OverwriteExistingFile.ALWAYS)
    written[name] = Path(name).exists()
    print(f"commonroad-io {version('commonroad-io')}, {name}: returned {returned}, file written: {written[name]}")
assert written == {"default": version("commonroad-io") == "2024.3", "xml": True}, written
PY
for number in 2024.3 2026.1; do
    python3.11 -m venv "$number"
    "$number/bin/pip" install -q "commonroad-io==$number"
    mkdir "in$number"
    (cd "in$number" && "../$number/bin/python" -W ignore ../find.py)
done
echo "the writer of 2026.1 writes no file by default"
