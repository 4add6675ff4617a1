"""Rows of the table of crashes, made up, as pages get them."""

from __future__ import annotations

from typing import Any


def crash(number: int, **changes: Any) -> dict[str, Any]:
    """A row of the table of crashes, one of many around a town."""
    return {
        "key": f"2023-{510001 + number}",
        "final_state": ("verified", "first_event_only", "rejected", "failed", "pending")[number % 5],
        "stage_reached": "verdict",
        "reason": "crash_off_road" if number % 4 == 1 else None,
        "detail": None,
        "outdated": None,
        "outdated_because": None,
        "cohort": "one",
        "latitude_deg": 37.0 + 0.01 * (number % 45),
        "longitude_deg": -78.0 + 0.01 * (number // 45),
        "kind": "two_vehicles",
        "collision_type": ("angle", "front_to_front", "rear_to_rear")[number % 3],
        "road_topology": "t",
        "vehicle_trajectory": "turning",
        "state_name": "Virginia",
        "place": f"Town {number % 7}, Virginia",
        "contact_distance_m": number / 100,
        **changes,
    }
