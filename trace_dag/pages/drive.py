"""An agent's drive in a replay: the agent, the outcome, and the recorded vehicle as a ghost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.crash.parties import party_label
from trace_dag.simulation.types import Body, SimulationLog


@dataclass(frozen=True)
class AgentDrive:
    """An agent by name in the place of participant ``number``; ``outcome`` in words, ``recorded`` the crash itself."""

    agent: str
    number: int
    outcome: str
    recorded: SimulationLog

    @property
    def title(self) -> str:
        """Return the driver's name and the outcome."""
        return f"{self.agent} drives {party_label(self.number)}: {self.outcome}"

    @property
    def body(self) -> Body:
        """Return the body the agent drove."""
        return self.recorded.bodies[self.number]

    def ghost(self, times_s: FloatArray) -> FloatArray:
        """Return poses of the recorded vehicle at some times, columns x, y (m) and heading (rad), shape (n, 3).

        After its end the vehicle stays at rest.
        """
        log = self.recorded.vehicle_log(self.number)
        columns = (log.x_m, log.y_m, np.unwrap(log.heading_rad))
        return np.stack([np.interp(times_s, log.time_s, values) for values in columns], axis=-1)

    def ghost_pose(self, time_s: float) -> Pose:
        """Return the pose of the recorded vehicle at a time."""
        x, y, heading = self.ghost(np.array([time_s]))[0].tolist()
        return Pose(x, y, heading)
