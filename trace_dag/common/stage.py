"""The seven stages of the flow, in order."""

from __future__ import annotations

from enum import StrEnum


class Stage(StrEnum):
    """The seven stages of the flow, in order. The value is the Dagster asset key and the folder name."""

    RAW_REPORT = "raw_report"
    CRASH_RECORD = "crash_record"
    OSM_EXTRACT = "osm_extract"
    ROAD_MAP = "road_map"
    STATE_ESTIMATE = "state_estimate"
    SIMULATION_LOG = "simulation_log"
    VERDICT = "verdict"

    @property
    def position(self) -> int:
        """Return the position in the flow, 0 for ``raw_report``."""
        return _POSITIONS[self]

    def and_later(self) -> tuple[Stage, ...]:
        """Return this stage and every one after it."""
        return tuple(Stage)[self.position :]


_POSITIONS = {stage: position for position, stage in enumerate(Stage)}
