"""Agents in the place of who left the road by itself. The tree stands 6 m right of the lane, 80 m ahead."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.agents.cases import BACKEND, FRICTION, RIGHT_M, drive
from tests.simulation.motions import participant
from tests.simulation.test_objects import TREE, item
from tests.verdict.crashes import STREET
from trace_dag.agents.evaluation.baselines import IdmLaneKeeper, Replay
from trace_dag.agents.evaluation.metrics import AVOIDED, DriveOutcome, Metrics, outcome_of
from trace_dag.scenario.cases import Case
from trace_dag.simulation.states import Trajectory

SPEED_MPS, IMPACT_S = 20.0, 4.0


def leaving(*, skids_from_s: float = math.inf) -> Case:
    """A car goes 40 m along its lane, then straight off to the right, to the tree."""
    time_s = np.arange(0.0, IMPACT_S + 1.0, 0.1)
    off = math.atan2(6.0, 40.0)
    gone_m = SPEED_MPS * time_s
    beyond_m = np.maximum(gone_m - 40.0, 0.0)
    path = Trajectory(
        time_s=time_s,
        x_m=np.minimum(gone_m, 40.0) + beyond_m * math.cos(off) - 80.0,
        y_m=RIGHT_M - beyond_m * math.sin(off),
        z_m=np.zeros_like(time_s),
        heading_rad=np.where(beyond_m > 0, -off, 0.0),
        speed_mps=np.full_like(time_s, SPEED_MPS),
    )
    driver = replace(participant(1, path), skids_from_s=skids_from_s)
    tree = item(TREE, 0.0, RIGHT_M - 6.0)
    simulation = BACKEND.load(STREET, b"", friction=FRICTION)
    recorded = simulation.run((driver,), time_limit_s=20.0, objects=(tree,))
    assert recorded.first_contact is not None
    impact_s = recorded.first_contact.time_s
    return Case("2023-1", "2023-1", STREET, b"", FRICTION, (driver,), impact_s, recorded, departed=1, objects=(tree,))


@pytest.mark.parametrize("skids_from_s", [math.inf, 2.0])
def test_the_recorded_drive_leaves_the_road_as_recorded(skids_from_s: float) -> None:
    result = drive(leaving(skids_from_s=skids_from_s), Replay())
    assert (result.role, result.outcome) == ("departing", DriveOutcome.UNCHANGED)
    assert result.metrics is not None
    assert result.metrics.contact_shift_s == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("skids_from_s", [math.inf, 2.0])
def test_an_agent_keeping_the_lane_avoids_the_departure(skids_from_s: float) -> None:
    result = drive(leaving(skids_from_s=skids_from_s), IdmLaneKeeper())
    assert result.outcome in AVOIDED
    assert result.metrics is not None
    assert result.metrics.off_road_s == 0.0


def test_overturning_weighs_more_than_delta_v() -> None:
    def outcome(*, collided: bool, delta_v: float, off: float, over: bool, recorded_over: bool) -> DriveOutcome:
        measures = Metrics(
            collided, None, None, None, None, delta_v, delta_v, 8.0, 8.0, None, None, off, 0, 0, 0, 0, 0, 0
        )
        measures = replace(measures, overturned=over, recorded_overturned=recorded_over, arrived=True)
        return outcome_of(measures, departed=True)

    assert outcome(collided=True, delta_v=2.0, off=1.0, over=True, recorded_over=False) is DriveOutcome.WORSE
    assert outcome(collided=True, delta_v=9.0, off=1.0, over=False, recorded_over=True) is DriveOutcome.MITIGATED
    assert outcome(collided=False, delta_v=0.0, off=3.0, over=False, recorded_over=False) is DriveOutcome.MITIGATED
    assert outcome(collided=False, delta_v=0.0, off=0.0, over=False, recorded_over=True) in AVOIDED
