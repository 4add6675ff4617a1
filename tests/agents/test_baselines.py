"""What each baseline makes of crashes whose right answer is known from physics."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.agents.cases import BACKEND, RIGHT_M, case, crossing, drive, rear_end
from tests.scenario import esmini
from tests.simulation.motions import driven, participant, straight
from tests.verdict.crashes import STREET
from trace_dag.agents.evaluation.agents import Motion, Observation
from trace_dag.agents.evaluation.baselines import (
    BrakeOnTimeToCollision,
    CarefulHuman,
    CautiousLaneKeeper,
    IdmLaneKeeper,
    Replay,
)
from trace_dag.agents.evaluation.evaluate import Conditions, run
from trace_dag.agents.evaluation.metrics import AVOIDED, DriveOutcome
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.cases import Case, Scenario


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
    assert slow.outcome is DriveOutcome.DID_NOT_ARRIVE, "it stands behind a car that stands"
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


class Motions:
    """Wishes for one motion all the time."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def reset(self, scenario: Scenario) -> None:
        """Nothing to remember."""

    def act(self, observation: Observation) -> Motion:
        return self._motion


@pytest.mark.parametrize(
    ("motion", "outcome"),
    [
        (Motion(target_speed_mps=1.0), DriveOutcome.DID_NOT_ARRIVE),
        (Motion(acceleration_mps2=0.0, steer_rad=0.6), DriveOutcome.DID_NOT_ARRIVE),
        (Motion(target_speed_mps=60.0), DriveOutcome.RULES_BROKEN),
    ],
)
def test_nobody_avoids_a_conflict_by_creeping_leaving_the_road_or_speeding(motion, outcome):
    assert drive(crossing(), Motions(motion)).outcome is outcome


def test_brakes_let_go_when_the_danger_is_over():
    found = drive(crossing(), BrakeOnTimeToCollision())
    assert found.outcome is DriveOutcome.COLLISION_AVOIDED
    assert found.metrics.arrived
    assert found.metrics.over_traffic_mps == 0.0


def test_the_careful_human_reacts_after_perception_and_delay() -> None:
    """At 30 m/s it sees the risk 2 s before a standing car and brakes 1.15 s later, 25.5 m before it. The brakes rise
    for 0.58 s, over 17 m and to 27.9 m/s; after another 0.32 s with 7.36 m/s2 it is there with 25.5 m/s, at 4.05 s."""
    found = drive(rear_end(30.0), CarefulHuman())
    assert found.outcome is DriveOutcome.MITIGATED
    assert found.metrics is not None
    assert found.metrics.contact_time_s == pytest.approx(4.05, abs=0.05)
    assert found.metrics.closing_speed_mps == pytest.approx(25.5, abs=1.0)


def braking_leader(braking_mps2: float, gap_m: float = 30.0) -> Case:
    """Number 2, ``gap_m`` ahead, both at 20 m/s, brakes from the first second on until it stands."""
    speed = lambda time_s: max(20.0 - braking_mps2 * max(time_s - 1.0, 0.0), 0.0)  # noqa: E731
    return case(
        STREET,
        participant(1, straight(-gap_m - 4.7, RIGHT_M, 0.0, 20.0, until_s=8.0)),
        participant(2, driven(0.0, RIGHT_M, 0.0, speed, lambda _: 0.0, until_s=8.0)),
        impact_time_s=4.2,
    )


def test_the_careful_human_follows_whoever_brakes_ahead() -> None:
    """Both at 20 m/s, 30 m apart; the one ahead brakes with 6 m/s2. Reacting after 1.15 s with 7.36 m/s2 it stands in
    23 + 27.2 m and some for the rise, the other in 33.3 m: 63.3 m are enough."""
    found = drive(braking_leader(6.0), CarefulHuman())
    assert not found.metrics.collided
    assert drive(braking_leader(6.0), Replay()).metrics.collided


def test_the_careful_human_brakes_as_esminis_driver_model_of_the_regulation(tmp_path) -> None:
    """Both see that the one ahead brakes with 6.5 m/s2 from 1 s on, and react 1.15 s later; ours by a vehicle whose
    brakes lag by 0.1 s, and no harder than its road of 0.75 allows (the regulation: 0.774)."""
    esmini.program()
    (tmp_path / "map.xodr").write_bytes(write_opendrive(STREET))
    scenario = tmp_path / "r157.xosc"
    shutil.copy(Path(__file__).parent / "r157.xosc", scenario)
    _, places, errors = esmini.play(scenario, 0.02, tmp_path)
    assert not errors
    theirs = places["behind"]
    of = braking_leader(6.5, gap_m=20.0)
    log = run(of, 1, CarefulHuman(), Conditions(), BACKEND.load(of.network, b"", friction=of.friction))
    own = log.vehicle_log(1)
    times_s = np.arange(0.05, 3.6, 0.05)
    speeds = [
        np.gradient(np.interp(times_s, clock_s, x_m), times_s)
        for clock_s, x_m in ((own.time_s, own.x_m), (theirs[:, 0], theirs[:, 1]))
    ]
    begins_s = [times_s[np.argmax(speed < 19.9)] for speed in speeds]
    assert begins_s[0] == pytest.approx(begins_s[1], abs=0.2)
    (ours, model) = ((speed[-14] - speed[-2]) / (times_s[-2] - times_s[-14]) for speed in speeds)
    assert ours == pytest.approx(model, rel=0.05)
    assert model == pytest.approx(0.774 * 9.81, rel=0.01)
