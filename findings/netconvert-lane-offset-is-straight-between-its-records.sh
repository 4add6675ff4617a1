#!/usr/bin/env bash
# Expected: ASAM OpenDRIVE 1.6, "Lane offset": the offset at s is the cubic polynomial of the record that is valid
#   there, so one record may carry the lanes 1.75 m aside and back along 100 m of straight road.
# Happens: netconvert takes the offset where geometries and records begin and end only. The lane comes out straight,
#   1.75 m from its place halfway, even at --opendrive.curve-resolution 1. CARLA and pyxodr follow the bow.
# Version: eclipse-sumo 1.28.0; carla 0.9.16 and pyxodr 0.1.3 for comparison (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q carla==0.9.16 eclipse-sumo==1.28.0 pyxodr==0.1.3
cd "$folder"
cat > find.py <<'PY'
import re
import subprocess
import sys
from importlib.metadata import version

import carla
from pyxodr.road_objects.network import RoadNetwork

ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" north="0" south="0" east="0" west="0"/>
<road id="1" length="100" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>
</planView><lanes><laneOffset s="0" a="0" b="0.07" c="-0.0007" d="0"/>
<laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"""

with open("road.xodr", "w") as file:
    file.write(ROAD)
in_carla = round(-carla.Map("road", ROAD).get_waypoint_xodr(1, -1, 50.0).transform.location.y, 2)
lane = RoadNetwork("road.xodr", resolution=0.5).get_roads()[0].lane_sections[0].lanes[0].centre_line
in_pyxodr = float(round(min(lane, key=lambda point: abs(point[0] - 50))[1], 2))
command = [sys.prefix + "/bin/netconvert", "--opendrive-files", "road.xodr", "--opendrive.curve-resolution", "1"]
said = subprocess.run([*command, "-o", "road.net.xml"], check=True, capture_output=True, text=True).stderr.strip()
with open("road.net.xml") as file:
    shape = re.search(r'<lane id="-1_0".*? shape="(.*?)"', file.read()).group(1)
print(", ".join(f"{name} {version(name)}" for name in ("eclipse-sumo", "carla", "pyxodr")))
print("expected side position of the lane's centre halfway: 0.0")
print("carla:", in_carla, " pyxodr:", in_pyxodr)
print("netconvert, the whole lane:", shape, " warnings:", said or "none")
assert abs(in_carla) < 0.05 and abs(in_pyxodr) < 0.05
assert all(abs(float(point.split(",")[1]) + 1.75) < 0.05 for point in shape.split()) and not said
print("netconvert keeps the lane at -1.75 all the way")
PY
venv/bin/python -W ignore find.py
