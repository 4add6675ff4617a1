#!/usr/bin/env bash
# Expected: OpenStreetMap's opening hours, by which turn restrictions and limits near schools hold, know public holidays
#   (PH) and school holidays (SH). A library without the calendar of a region can answer "unknown", which this one has as
#   a state; it knows the public holidays of the United States.
# Happens: no day is ever a school holiday, and the answer is certain: "SH 07:00-16:00" is closed on every hour of two
#   years, and "Mo-Fr 07:00-09:00; SH off" is open in the middle of summer holidays. Nothing warns.
# Version: opening-hours-py 2.1.4 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q opening-hours-py==2.1.4
cd "$folder"
cat > find.py <<'PY'
from datetime import datetime, timedelta
from importlib.metadata import version

from opening_hours import OpeningHours, State

print("opening-hours-py", version("opening-hours-py"))
public = OpeningHours("Mo-Fr 07:00-09:00; PH off", country="US").state(datetime(2023, 7, 4, 8))[0]
print("Independence Day at 8, Mo-Fr 07:00-09:00; PH off:", public)
school = {}
for country in ("US", "DE", "FR"):
    hours = [datetime(2023, 1, 1) + timedelta(hours=hour) for hour in range(2 * 365 * 24)]
    in_holidays = OpeningHours("SH 07:00-16:00", country=country)
    school[country] = {str(in_holidays.state(hour)[0]) for hour in hours}
    summer = OpeningHours("Mo-Fr 07:00-09:00; SH off", country=country).state(datetime(2023, 8, 2, 8))[0]
    print(f"{country}: SH 07:00-16:00 in two years: {school[country]}; 2 August at 8, SH off: {summer}")
    assert summer == State.OPEN
assert public == State.CLOSED
assert all(states == {str(State.CLOSED)} for states in school.values())
print("there are public holidays and no school holidays, and no answer is unknown")
PY
venv/bin/python -W ignore find.py
