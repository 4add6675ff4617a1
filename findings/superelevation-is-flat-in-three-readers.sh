#!/usr/bin/env bash
# Expected: ASAM OpenDRIVE 1.6, "Superelevation": the cross section of a road is turned about the reference line by
#   the angle of the record, so that at 0.12 rad a lane whose centre is 1.75 m to the right lies 0.21 m lower.
# Happens: CARLA, netconvert and pyxodr read the file without an error and lay both lanes level at the
#   height of the reference line; the waypoint of CARLA has a roll of zero as well. A banked curve is a flat one in all three.
# Version: carla 0.9.16, eclipse-sumo 1.28.0, pyxodr 0.1.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q carla==0.9.16 eclipse-sumo==1.28.0 pyxodr==0.1.3
cd "$folder"
cat > find.py <<'PY'
import math
import re
import subprocess
import sys
from importlib.metadata import version

import carla
from pyxodr.road_objects.network import RoadNetwork

LANE = '<lane id="{}" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
ROAD = f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" north="0" south="0" east="0" west="0"/>
<road id="1" length="100" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="100"><arc
curvature="0.005"/></geometry></planView>
<elevationProfile><elevation s="0" a="10" b="0" c="0" d="0"/></elevationProfile>
<lateralProfile><superelevation s="0" a="0.12" b="0" c="0" d="0"/></lateralProfile>
<lanes><laneSection s="0"><left>{LANE.format(1)}</left><center><lane id="0" type="none" level="false"/></center>
<right>{LANE.format(-1)}</right></laneSection></lanes></road></OpenDRIVE>"""

with open("road.xodr", "w") as file:
    file.write(ROAD)
carla_map = carla.Map("road", ROAD)
points = [carla_map.get_waypoint_xodr(1, lane, 50.0).transform for lane in (1, -1)]
in_carla = [(round(p.location.z, 3), round(p.rotation.roll, 3)) for p in points]
command = [sys.prefix + "/bin/netconvert", "--opendrive-files", "road.xodr", "-o", "road.net.xml"]
subprocess.run(command, check=True, capture_output=True)
with open("road.net.xml") as file:
    shapes = re.findall(r'<lane id="-?1_0".*? shape="(.*?)"', file.read())
in_sumo = sorted({point.split(",")[2] for shape in shapes for point in shape.split()})
section = RoadNetwork("road.xodr", resolution=1.0).get_roads()[0].lane_sections[0]
in_pyxodr = sorted({float(round(z, 3)) for lane in section.lanes for z in lane.centre_line[:, 2]})
print(", ".join(f"{name} {version(name)}" for name in ("carla", "eclipse-sumo", "pyxodr")))
print(f"expected heights of the left and right lane: {10 + 1.75 * math.sin(0.12):.2f} and {10 - 1.75 * math.sin(0.12):.2f}")
print("carla, height and roll of the left and right lane:", in_carla)
print("netconvert, all heights of both lanes:", in_sumo)
print("pyxodr, all heights of both lanes:", in_pyxodr)
assert in_carla == [(10.0, 0.0), (10.0, 0.0)]
assert in_sumo == ["10.00"]
assert in_pyxodr == [10.0]
print("the superelevation of 0.12 rad has no effect in any of the three")
PY
venv/bin/python -W ignore find.py
