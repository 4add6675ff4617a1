#!/usr/bin/env bash
# Expected: ASAM OpenDRIVE 1.6, "Speed limits": `<speed>` in a road's `<type>` is the limit of the road and holds in all its
#   lanes; a lane's own `<speed>` replaces it there.
# Happens: lanes of a road that has its limit in `<type>` have none (`speed_limit` is None, with a warning about "unit
#   None"); only a limit that each lane repeats is there. Editors write the road's, so most maps come without limits.
# Version: tactics2d 0.1.9 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q tactics2d==0.1.9
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

from tactics2d.map.parser import XODRParser

SPEED = '<speed {}max="35" unit="mph"/>'
ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="road" north="9" south="-9" east="100" west="0"/>
<road id="1" name="" length="100" junction="-1"><type s="0" type="town">{road}</type><planView><geometry s="0" x="0"
y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0"><center><lane id="0" type="none"
level="false"/></center><right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0"
d="0"/>{lane}</lane></right></laneSection></lanes></road></OpenDRIVE>"""


def limits(**speeds):
    with open("road.xodr", "w") as file:
        file.write(ROAD.format(**speeds))
    return [lane.speed_limit for lane in XODRParser().parse("road.xodr").lanes.values()]


of_road = limits(road=SPEED.format(""), lane="")
of_lane = limits(road="", lane=SPEED.format('sOffset="0" '))
print(f"tactics2d {version('tactics2d')}")
print("35 mph in the road's type, m/s:", of_road)
print("35 mph in the lane, m/s:", of_lane)
assert of_road == [None] and abs(of_lane[0] - 15.65) < 0.01
print("the limit of the road is lost")
PY
venv/bin/python find.py 2>/dev/null
