#!/usr/bin/env bash
# Expected: OpenDRIVE lets a lane section hold for one side of the road alone (singleSide="true", in the standard since 1.4
#   "to simplify the use of lane sections for complex roads"). A street of two lanes each way whose right side narrows to
#   one lane at 50 m needs a second section with the right lane only; the left lanes go on.
# Happens: CARLA, netconvert and pyxodr read the second section as the whole road: both left lanes end at 50 m, so that
#   oncoming traffic begins in the middle of the street.
# Version: carla 0.9.16, eclipse-sumo 1.28.0 (netconvert), pyxodr 0.1.3 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q carla==0.9.16 eclipse-sumo==1.28.0 pyxodr==0.1.3
cd "$folder"
cat > find.py <<'PY'
import re
import subprocess
from importlib.metadata import version
from pathlib import Path

import carla
import sumo
from pyxodr.road_objects.network import RoadNetwork


def lanes(*ids):
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    return "".join(f'<lane id="{number}" type="driving" level="false">{width}</lane>' for number in ids)


CENTRE = '<center><lane id="0" type="none" level="false"/></center>'
opendrive = f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="7" name="street"/>
<road name="street" length="100" id="1" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes>
<laneSection s="0" singleSide="false"><left>{lanes(2, 1)}</left>{CENTRE}<right>{lanes(-1, -2)}</right></laneSection>
<laneSection s="50" singleSide="true">{CENTRE}<right>{lanes(-1)}</right></laneSection>
</lanes></road></OpenDRIVE>"""
Path("street.xodr").write_text(opendrive)

street = carla.Map("street", opendrive)
found = {"CARLA": [n for n in (2, 1, -1, -2) if street.get_waypoint_xodr(1, n, 75.0)]}
netconvert = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
subprocess.run([netconvert, "--opendrive-files", "street.xodr", "-o", "street.net.xml"], check=True, capture_output=True)
shapes = re.findall(r'<lane id="[^:"][^>]*shape="([^"]*)"', Path("street.net.xml").read_text())
middles = {float(shape.split()[0].split(",")[1]) for shape in shapes if max(float(p.split(",")[0]) for p in shape.split()) > 75}
found["netconvert"] = sorted({5.25: 2, 1.75: 1, -1.75: -1, -5.25: -2}[each] for each in middles)
(road,) = RoadNetwork("street.xodr", resolution=0.5, ignored_lane_types={"none"}).get_roads()
found["pyxodr"] = sorted(lane.id for lane in road.lane_sections[-1].lanes)
print("carla", version("carla"), "eclipse-sumo", version("eclipse-sumo"), "pyxodr", version("pyxodr"))
print("lanes at 75 m by the standard: [2, 1, -1]")
for reader, ids in found.items():
    print(f"lanes at 75 m in {reader}: {ids}")
assert all(ids == [-1] for ids in found.values())
print("the side that a section does not speak of has no lanes there, in all three")
PY
venv/bin/python -W ignore find.py 2> /dev/null
