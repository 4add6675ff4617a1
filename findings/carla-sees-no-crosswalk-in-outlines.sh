#!/usr/bin/env bash
# Expected: OpenDRIVE draws a crosswalk as an object of type "crosswalk" with an outline of corners, local to the object
#   (cornerLocal) or along the road (cornerRoad). Since version 1.5 outlines stand in an <outlines> element; <outline>
#   directly in <object> is the older form. carla.Map.get_crosswalks() returns the corners of all crosswalks.
# Happens: of the four ways to write one rectangle across a street, CARLA returns the one that is oldest: local corners
#   directly in the object. In <outlines>, or with corners along the road, the crosswalk is not there, without a message.
#   Pedestrians that follow CARLA's crosswalks cross elsewhere.
# Version: carla 0.9.16 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q carla==0.9.16
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import carla

LANE = '<lane id="{}" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
CORNERS = [(-1.5, -3.5), (1.5, -3.5), (1.5, 3.5), (-1.5, 3.5)]
LOCAL = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="0"/>' for u, v in CORNERS)
ALONG = "".join(f'<cornerRoad s="{50 + u}" t="{v}" dz="0" height="0"/>' for u, v in CORNERS)


def crosswalk(outline):
    opendrive = f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="7" name="street"/>
<road name="street" length="100" id="1" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><left>{LANE.format(1)}</left><center><lane id="0" type="none" level="false"/></center>
<right>{LANE.format(-1)}</right></laneSection></lanes>
<objects><object id="9" name="crosswalk" type="crosswalk" s="50" t="0" zOffset="0" orientation="none" hdg="0"
 length="3" width="7">{outline}</object></objects></road></OpenDRIVE>"""
    return [(round(place.x, 2), round(-place.y, 2)) for place in carla.Map("street", opendrive).get_crosswalks()]


def inside(corners):
    return f'<outline id="0" closed="true">{corners}</outline>'


print("carla", version("carla"))
found = {
    "local corners, <outline> in the object": crosswalk(inside(LOCAL)),
    "local corners, <outline> in <outlines>": crosswalk(f"<outlines>{inside(LOCAL)}</outlines>"),
    "corners along the road, <outline> in the object": crosswalk(inside(ALONG)),
    "corners along the road, <outline> in <outlines>": crosswalk(f"<outlines>{inside(ALONG)}</outlines>"),
}
for way, corners in found.items():
    print(f"{way}: {corners}")
first, *others = found.values()
assert sorted(first) == sorted((50 + u, v) for u, v in CORNERS)
assert others == [[], [], []]
print("three of four ways to write a crosswalk leave CARLA without it")
PY
venv/bin/python -W ignore find.py
