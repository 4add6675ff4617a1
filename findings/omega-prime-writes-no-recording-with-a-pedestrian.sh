#!/usr/bin/env bash
# Expected: a recording that passes the check of omega-prime's table can be written as a trace of ASAM OSI, pedestrians as well
#   as vehicles; a pedestrian has no role and no type of vehicle, for which the table has -1 (0 is refused).
# Happens: a recording of a car goes to MCAP and comes back; one of a pedestrian, checked and found right, raises a
#   `ValueError` as it is written, since -1 is no value of OSI's enumeration of roles. Read from a trace it cannot be
#   written either.
# Version: omega-prime 0.3.7 with betterosi 0.9.0 (PyPI).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3.11 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q omega-prime==0.3.7 betterosi==0.9.0
cd "$folder"
cat > find.py <<'PY'
from importlib.metadata import version

import numpy as np
import omega_prime
import polars as pl

STEPS, ZERO = np.arange(5), [0.0] * 5


def written(kind, role, subtype):
    """Return the outcome of a recording of one object, in words: refused by the check, by the writer, or read back."""
    columns = {name: ZERO for name in ("y", "z", "vel_y", "vel_z", "acc_x", "acc_y", "acc_z", "roll", "pitch", "yaw")}
    columns |= {"total_nanos": STEPS * 100_000_000, "x": STEPS * 1.0, "vel_x": [10.0] * 5, "idx": [1] * 5}
    columns |= {"length": [0.5] * 5, "width": [0.5] * 5, "height": [1.8] * 5}
    frame = pl.DataFrame({**columns, "type": [kind] * 5, "role": [role] * 5, "subtype": [subtype] * 5})
    try:
        recording = omega_prime.Recording(frame, validate=True)
    except Exception:
        return "refused by the check"
    try:
        recording.to_mcap("trace.mcap")
    except ValueError as error:
        return f"right by the check, then: {error}"
    return f"read back, {len(omega_prime.Recording.from_file('trace.mcap').df)} states"


car, person, person_zero = written(2, 0, 4), written(3, -1, -1), written(3, 0, 0)
print(f"omega-prime {version('omega-prime')}, betterosi {version('betterosi')}")
print("a car:", car)
print("a pedestrian without role and type:", person)
print("a pedestrian with 0 for both:", person_zero)
assert car == "read back, 5 states"
assert "invalid enum value -1" in person
assert person_zero == "refused by the check"
print("no recording with a pedestrian can be written")
PY
venv/bin/python -W ignore find.py
