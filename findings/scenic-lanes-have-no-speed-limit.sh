#!/usr/bin/env bash
# Expected: Scenic's driving domain documents `speedLimit` of its lanes and roads, in m/s, None if the map has none; ASAM
#   OpenDRIVE 1.6 has limits in a road's `<type>` and in its lanes.
# Happens: with a limit in both places every road, lane and lane section of the network has None: a behaviour that keeps to
#   the limit drives as if there were none, without a warning.
# Version: scenic 3.1.1 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q scenic==3.1.1
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

from scenic.domains.driving.roads import Network

ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" north="0" south="0" east="0" west="0"/>
<road id="1" length="100" junction="-1"><type s="0" type="town"><speed max="35" unit="mph"/></type><planView><geometry
s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0"><center><lane id="0"
type="none" level="false"/></center><right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0"
c="0" d="0"/><speed sOffset="0" max="35" unit="mph"/></lane></right></laneSection></lanes></road></OpenDRIVE>"""

with open("road.xodr", "w") as file:
    file.write(ROAD)
network = Network.fromFile("road.xodr", useCache=False)
elements = [*network.allRoads, *network.lanes, *network.laneSections]
limits = {type(each).__name__: each.speedLimit for each in elements}
print(f"scenic {version('scenic')}")
print("limits of a road of 35 mph (15.65 m/s):", limits)
assert set(limits.values()) == {None}
print("no element of the network has the limit")
PY
venv/bin/python -W ignore find.py
