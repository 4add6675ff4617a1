#!/usr/bin/env bash
# Expected: ASAM OpenDRIVE 1.6, `<speed>`: a road whose `<type>` has none has no limit in the file. A reader shows that as a
#   missing limit, as its list of speed limits of a lane could by being empty.
# Happens: each lane of such a road has one entry, 13.89 m/s (50 km/h) along all of it, which nothing distinguishes from
#   the entry of a road that is tagged with 50 km/h; no message is printed. On a freeway without a tag that is half of the usual speed.
# Version: ad-map-access 3.0.0 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q ad-map-access==3.0.0
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import ad_map_access as ad

ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" north="0" south="0" east="0" west="0"><geoReference>+proj=tmerc +lat_0=41
+lon_0=-101 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs</geoReference></header>
<road id="1" length="100" junction="-1"><type s="0" type="{kind}">{speed}</type><planView><geometry s="0" x="0" y="0"
hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0"><center><lane id="0" type="none"
level="false"/></center><right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0"
d="0"/></lane></right></laneSection></lanes></road></OpenDRIVE>"""


def limits(text):
    kinds = ad.map.intersection.IntersectionType.Unknown, ad.map.landmark.TrafficLightType.UNKNOWN
    assert ad.map.access.initFromOpenDriveContent(text, 0.2, *kinds)
    lanes = [ad.map.lane.getLane(each) for each in ad.map.lane.getLanes()]
    found = [[round(each.speed_limit.mSpeed, 2) for each in lane.speed_limits] for lane in lanes]
    ad.map.access.cleanup()
    return found


without = limits(ROAD.format(kind="motorway", speed=""))
tagged = limits(ROAD.format(kind="town", speed='<speed max="50" unit="km/h"/>'))
print(f"ad-map-access {version('ad-map-access')}")
print("a motorway without a limit:", without)
print("a street with a limit of 50 km/h:", tagged)
assert without == tagged == [[13.89]]
print("a missing limit is one of 50 km/h")
PY
venv/bin/python find.py 2>/dev/null
