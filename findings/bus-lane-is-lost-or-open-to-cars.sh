#!/usr/bin/env bash
# Expected: OpenDRIVE has two ways to say that a lane is for buses: the lane type "bus", and a driving lane with
#   <access rule="allow" restriction="bus"/>. A reader keeps the lane either way, and lets no car into it.
# Happens: netconvert drops a lane of type "bus" from the network and reads the access; CARLA gives the lane of type "bus" no
#   type at all and takes the one with the access for a driving lane, open to cars. No way of writing suits both.
# Version: carla 0.9.16, eclipse-sumo 1.28.0 (netconvert) (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q carla==0.9.16 eclipse-sumo==1.28.0
cd "$folder"
cat > find.py <<'PY'
import re
import subprocess
from importlib.metadata import version
from pathlib import Path

import carla
import sumo

WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'


def read(kind, access):
    opendrive = f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="7" name="street"/>
<road name="street" length="100" id="1" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0">
<center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false">{WIDTH}</lane>
<lane id="-2" type="{kind}" level="false">{WIDTH}{access}</lane></right>
</laneSection></lanes></road></OpenDRIVE>"""
    Path("street.xodr").write_text(opendrive)
    outer = carla.Map("street", opendrive).get_waypoint_xodr(1, -2, 50.0)
    netconvert = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
    command = [netconvert, "--opendrive-files", "street.xodr", "-o", "street.net.xml"]
    subprocess.run(command, check=True, capture_output=True)
    lanes = re.findall(r'<lane id="-1_\d" [^>]*', Path("street.net.xml").read_text())
    outer_in_sumo = [lane for lane in lanes if "-5.25" in lane]
    access = re.findall(r'allow="([^"]*)"', outer_in_sumo[0])[0] if outer_in_sumo else "no such lane"
    return str(outer.lane_type), access


print("carla", version("carla"), "eclipse-sumo", version("eclipse-sumo"))
by_type = read("bus", "")
by_access = read("driving", '<access sOffset="0" rule="allow" restriction="bus"/>')
print("lane of type bus:         CARLA", by_type[0], "  netconvert:", by_type[1])
print("driving lane, bus access: CARLA", by_access[0], "  netconvert: for", by_access[1])
assert by_type == ("NONE", "no such lane")
assert by_access == ("Driving", "bus")
print("a bus lane is lost in both, or open to cars in CARLA")
PY
venv/bin/python -W ignore find.py 2> /dev/null
