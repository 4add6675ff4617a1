"""What each baseline makes of crashes whose right answer is known from physics."""

from __future__ import annotations

import numpy as np
import pytest

from tests.evaluation.cases import BACKEND, RIGHT_M, crossing, drive, rear_end
from trace_dag.evaluation.baselines import BrakeOnTimeToCollision, CautiousLaneKeeper, IdmLaneKeeper, Replay
from trace_dag.evaluation.evaluate import Conditions, run
from trace_dag.evaluation.metrics import AVOIDED, DriveOutcome


@pytest.mark.parametrize("ego", [1, 2])
@pytest.mark.parametrize("of", [rear_end, crossing])
def test_replay_is_the_recorded_crash(of, ego):
    found = drive(of(), Replay(), ego)
    assert found.outcome is DriveOutcome.UNCHANGED
    assert found.metrics is not None
    assert found.metrics.contact_shift_s == 0.0
    assert found.metrics.contact_shift_m == 0.0
    assert found.metrics.delta_v_mps == found.metrics.recorded_delta_v_mps


def test_brakes_avoid_what_they_can_and_soften_what_they_cannot():
    # From 1.5 s before a standing car: v * 1.5 s against v^2 / (2 * 7.35 m/s2) plus the pedal's lag of 0.1 s.
    slow, fast = drive(rear_end(15.0), BrakeOnTimeToCollision()), drive(rear_end(30.0), BrakeOnTimeToCollision())
    assert slow.outcome in AVOIDED
    assert fast.outcome is DriveOutcome.MITIGATED
    assert slow.metrics is not None
    assert 6.5 < slow.metrics.max_deceleration_mps2 < 7.5


def test_nobody_brakes_for_who_comes_from_behind():
    found = drive(rear_end(), BrakeOnTimeToCollision(), ego=2)
    assert found.outcome is DriveOutcome.UNCHANGED


@pytest.mark.parametrize("agent", [IdmLaneKeeper, CautiousLaneKeeper])
def test_lane_keepers_stop_behind_a_standing_car_without_swaying_or_stuttering(agent):
    of = rear_end(15.0)
    log = run(of, 1, agent(), Conditions(), BACKEND.load(of.network, b"", friction=of.friction))
    own = log.vehicles[0]
    assert not log.contacts
    assert np.abs(own.y_m - RIGHT_M).max() < 0.05
    assert own.speed_mps[-1] < 0.5 * own.speed_mps[0]
    braking = own.brake[own.speed_mps > 1.0] > 0.02
    assert np.count_nonzero(np.diff(braking.astype(int)) == 1) <= 2, "brakes go on once, not again and again"


def test_the_cautious_one_gives_way_at_a_crossing_where_the_lane_keeper_does_not_look():
    assert drive(crossing(), CautiousLaneKeeper()).outcome in AVOIDED
    lane_keeper = drive(crossing(), IdmLaneKeeper())
    assert lane_keeper.outcome not in AVOIDED
