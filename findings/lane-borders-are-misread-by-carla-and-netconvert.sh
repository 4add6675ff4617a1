#!/usr/bin/env bash
# Expected: ASAM OpenDRIVE 1.6, "Lane borders": a lane may state its outer limit with <border> in place of <width>.
#   Limits 3.5 m and 7.5 m left of the centre line therefore describe the same two lanes as widths 3.5 m and 4 m.
# Happens: CARLA warns that there is no <width>, gives both lanes a width of zero and puts their centres on the centre
#   line of the road. netconvert gives both its standard width of 3.65 m without a word. Only pyxodr reads the same
#   lanes both ways.
# Version: carla 0.9.16, eclipse-sumo 1.28.0, pyxodr 0.1.3 (PyPI).
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
</planView><lanes><laneSection s="0"><left>{lanes}</left><center><lane id="0" type="none" level="false"/></center>
</laneSection></lanes></road></OpenDRIVE>"""
LANE = '<lane id="{}" type="driving" level="false"><{} sOffset="0" a="{}" b="0" c="0" d="0"/></lane>'


def read(record, outer, inner):
    text = ROAD.format(lanes=LANE.format(2, record, outer) + LANE.format(1, record, inner))
    with open("road.xodr", "w") as file:
        file.write(text)
    carla_map = carla.Map("road", text)
    points = [carla_map.get_waypoint_xodr(1, lane, 50.0) for lane in (1, 2)]
    in_carla = [(round(p.lane_width, 2), round(abs(p.transform.location.y), 2)) for p in points]
    netconvert = [sys.prefix + "/bin/netconvert", "--opendrive-files", "road.xodr", "-o", "road.net.xml"]
    said = subprocess.run(netconvert, check=True, capture_output=True, text=True).stderr.strip()
    with open("road.net.xml") as file:
        lanes = re.findall(r'<lane id="1_.*? width="([\d.]+)" shape="[\d.]+,([\d.]+)', file.read())
    in_sumo = [(float(width), float(y)) for width, y in reversed(lanes)]
    network = RoadNetwork("road.xodr", resolution=1.0)
    section = network.get_roads()[0].lane_sections[0]
    in_pyxodr = [float(round(abs(lane.centre_line[50][1]), 2)) for lane in sorted(section.lanes, key=lambda x: x.id)]
    print(f"<{record}> {inner} and {outer}")
    print("  carla, width and distance of the centre:", in_carla)
    print("  netconvert, the same:                   ", in_sumo, "warnings:", said or "none")
    print("  pyxodr, distance of the centre:         ", in_pyxodr)
    return in_carla, in_sumo, in_pyxodr, said


print(", ".join(f"{name} {version(name)}" for name in ("carla", "eclipse-sumo", "pyxodr")))
by_width = read("width", 4, 3.5)
by_border = read("border", 7.5, 3.5)
assert by_width[:3] == ([(3.5, 1.75), (4.0, 5.5)], [(3.5, 1.75), (4.0, 5.5)], [1.75, 5.5]), by_width
assert by_border[0] == [(0.0, 0.0), (0.0, 0.0)], by_border
assert [width for width, _ in by_border[1]] == [3.65, 3.65] and not by_border[3], by_border
assert by_border[2] == [1.75, 5.5], by_border
print("carla has lanes without width, netconvert lanes of 3.65 m")
PY
venv/bin/python -W ignore find.py
