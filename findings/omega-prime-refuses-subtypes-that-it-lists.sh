#!/usr/bin/env bash
# Expected: ASAM OSI 3.8 has 23 types of vehicles, 0 to 22; the check of omega-prime's table names each of them as allowed.
# Happens: 18 (micromobility device), 19 (work machine), 20 (watercraft), 21 (aircraft) and 22 (land vehicle) are refused by
#   a message that lists them as allowed: the range that is checked ends at 17. A recording with one e-scooter rider
#   or one road roller is not valid; without validation it is read.
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

STEPS = np.arange(5)
ZERO = [0.0] * 5


def refused(subtype):
    """Return whether a recording of one vehicle of a type is refused, and whether the message lists that type."""
    columns = {name: ZERO for name in ("y", "z", "vel_y", "vel_z", "acc_x", "acc_y", "acc_z", "roll", "pitch", "yaw")}
    columns |= {"total_nanos": STEPS * 100_000_000, "x": STEPS * 1.0, "vel_x": [10.0] * 5, "idx": [1] * 5}
    columns |= {"length": [1.0] * 5, "width": [0.5] * 5, "height": [1.8] * 5}
    frame = pl.DataFrame({**columns, "type": [2] * 5, "role": [0] * 5, "subtype": [subtype] * 5})
    try:
        omega_prime.Recording(frame, validate=True)
    except Exception as error:
        return True, f": {subtype}," in str(error) or f": {subtype}}}" in str(error)
    return False, None


found = {subtype: refused(subtype) for subtype in range(23)}
print(f"omega-prime {version('omega-prime')}, betterosi {version('betterosi')}")
print("refused:", [subtype for subtype, (is_refused, _) in found.items() if is_refused])
print("refused, and listed as allowed in the message:", [subtype for subtype, each in found.items() if each == (True, True)])
assert [subtype for subtype, each in found.items() if each == (True, True)] == [18, 19, 20, 21, 22]
assert not any(is_refused for is_refused, _ in list(found.values())[:18])
print("the five highest types are listed and refused")
PY
venv/bin/python -W ignore find.py
