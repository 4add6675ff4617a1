"""How hard vehicles of stored crashes strike what stands beside the road, beside what was measured of real ones.

    python -m benchmarks.departure_severity ROOT

The impact severity of a departure is the energy of a vehicle's motion across the road: half its mass times the square
of speed times the sine of the angle between course and road. NCHRP Report 665 (2010, table 78) has it of 868 crashes
that were reconstructed; nothing of it is in the program. Of the root's verified crashes those count in which a car,
SUV, van or pickup struck a fixed object to its left or right.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from trace_dag.flow.workspace import WAREHOUSE_FILE
from trace_dag.warehouse.query import query

MEASURED = {"median": 18.46, "mean": 38.91, "90 of 100 below": 98.54}
"""kJ, all classes of roads."""
_DEPARTURES = """
WITH shown AS (
    SELECT
        key,
        max(value) FILTER (criterion = 'angle_to_road') AS angle_deg,
        max(value) FILTER (criterion = 'impact_speed') AS speed_mps,
        bool_or(criterion = 'departure_side' AND passed) AS aside
    FROM verdict_criteria
    GROUP BY key
)
SELECT angle_deg, speed_mps, mass_kg
FROM shown
JOIN crashes USING (key)
JOIN vehicles USING (key)
WHERE
    crashes.kind = 'fixed_object' AND crashes.final_state = 'verified' AND aside
    AND vehicles.vehicle_number = 1 AND vehicles.vehicle_class IN ('car', 'suv', 'van', 'pickup')
    AND angle_deg IS NOT NULL
"""


def severity_kj(angle_deg: float, speed_mps: float, mass_kg: float) -> float:
    """Energy across the road."""
    return mass_kg * (speed_mps * math.sin(math.radians(angle_deg))) ** 2 / 2000


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    _, rows = query(parser.parse_args().root / WAREHOUSE_FILE, _DEPARTURES)
    found = np.array([severity_kj(*map(float, row)) for row in rows])
    angles_deg = np.array([float(row[0]) for row in rows])
    simulated = dict(zip(MEASURED, (np.median(found), found.mean(), np.percentile(found, 90)), strict=True))
    print(f"{len(found)} departures; angle to the road {np.median(angles_deg):.1f} degrees in the median")
    print(f"{'impact severity, kJ':24}{'simulated':>12}{'measured':>12}")
    for name, measured in MEASURED.items():
        print(f"{name:24}{simulated[name]:12.1f}{measured:12.1f}")


if __name__ == "__main__":
    main()
