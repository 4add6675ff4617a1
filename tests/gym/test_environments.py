"""Crashes as environments: what Gymnasium and PettingZoo ask of one, and that it is the crash that was simulated."""

from __future__ import annotations

import copy
import math
import warnings
import webbrowser

import gymnasium
import numpy as np
import pytest
import sample_runs
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import trace_dag
import trace_dag.gym
from trace_dag.agents.evaluation.baselines import Replay
from trace_dag.agents.evaluation.evaluate import Conditions, evaluate, run
from trace_dag.agents.evaluation.observation import Sensing
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.errors import UserError
from trace_dag.gym.parallel import ParallelCrashEnv
from trace_dag.gym.single import chosen
from trace_dag.gym.spaces import MANOEUVRES, Hands

KEY = "2023-319003"
RECORDED, BRAKE_HARD = (
    next(number for number, (name, _, _) in enumerate(MANOEUVRES) if name == wanted)
    for wanted in ("recorded", "brake_hard")
)


@pytest.fixture(scope="module")
def home():
    return trace_dag.open(sample_runs.finished())


def make(home, **arguments):
    return gymnasium.make(trace_dag.gym.ENVIRONMENT, home=home, **{"key": KEY, **arguments})


def driven(env, action, **reset):
    """Everything an episode gives with one action throughout."""
    given = [env.reset(**reset)]
    while True:
        given.append(env.step(action))
        if given[-1][2] or given[-1][3]:
            return given


@pytest.mark.parametrize("actions", ["continuous", "discrete"])
def test_gymnasium_finds_nothing_to_warn_of(home, actions):
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(make(home, actions=actions, render_mode="rgb_array").unwrapped)
    assert [str(warning.message) for warning in warned] == []


def test_pettingzoo_finds_nothing_wrong():
    root = sample_runs.finished()
    assert ParallelCrashEnv(root, KEY).possible_agents
    parallel_api_test(ParallelCrashEnv(root, KEY), num_cycles=70)
    parallel_seed_test(lambda: ParallelCrashEnv(root, KEY), num_cycles=10)


def test_the_recorded_driver_has_the_recorded_crash(home):
    env = make(home, actions="discrete")
    *_, (_, _, terminated, truncated, info) = driven(env, RECORDED, seed=1)
    track = env.unwrapped.tracks[KEY]
    assert (terminated, truncated, info["outcome"]) == (True, False, "unchanged")
    same = evaluate(track.case, info["ego"], Replay(), Conditions(), track.simulation)
    assert info["metrics"]["contact_time_s"] == same.metrics.contact_time_s
    assert info["metrics"]["contact_shift_m"] == pytest.approx(0.0, abs=1e-6)


def test_the_light_ahead_is_the_crashs_until_its_stop_line_is_crossed(home):
    """A motorcycle straight on at 30 mph: 2 s before it crosses, the line is 27 m ahead."""
    env = make(home, actions="discrete", ego=2)
    infos = [given[-1] for given in driven(env, RECORDED, seed=1)]
    (met,) = (each for each in env.unwrapped.tracks[KEY].case.lights.met if each.party == 2)
    crosses = round(met.time_s * 10)
    assert {info["light"] for info in infos[: crosses - 1]} == {str(met.shown)} == {"green"}
    way_m = [info["light_m"] for info in infos[: crosses - 1]]
    assert way_m == sorted(way_m, reverse=True)
    assert way_m[crosses - 20] == pytest.approx(2 * 30 / 2.237, abs=1.5)
    assert (infos[crosses + 1]["light"], infos[crosses + 1]["light_m"]) == (None, None)


def test_environments_of_one_place_share_what_is_loaded(home):
    first, second = (make(home).unwrapped.tracks[KEY] for _ in range(2))
    assert first is second
    assert first.loaded is second.loaded


def test_reactive_traffic_leaves_the_recorded_crash_and_keeps_its_distance_from_who_drives_otherwise(home):
    env = make(home, actions="discrete", traffic="reactive")
    *_, (_, _, terminated, _, info) = driven(env, RECORDED, seed=1)
    assert (terminated, info["outcome"]) == (True, "unchanged")
    driven(env, BRAKE_HARD, seed=1)
    other = next(each for each in env.unwrapped._episode.log.vehicles if each.number != info["ego"])
    recorded = next(each for each in braked_log(home).vehicles if each.number == other.number)
    assert other.speed_mps.mean() <= recorded.speed_mps.mean() + 0.1
    with pytest.raises(UserError, match="traffic 'none': expected recorded, reactive, persistent"):
        make(home, traffic="none")


def test_persistent_traffic_waits_for_who_is_slow(home):
    """Half the recorded speed leads into the conflict all the same, and info says which crash that was."""
    env = make(home, actions="continuous", traffic="persistent")
    _, info = env.reset(seed=1)
    assert info["key"] == info["case_id"] == KEY
    *_, (_, _, terminated, _, told) = driven(env, np.array([-0.1, 0.0], np.float32), seed=1)
    assert told["key"] == KEY
    assert terminated or told["outcome"] == "did_not_arrive"


@pytest.mark.parametrize("action", [[math.nan, 0.0], [0.0, math.inf], [0.0], 0.5])
def test_an_action_that_is_not_two_finite_numbers_is_refused_as_an_evaluation_does(home, action):
    env = make(home, actions="continuous")
    env.reset(seed=1)
    with pytest.raises(UserError, match="expected two finite numbers"):
        env.unwrapped.step(action)


@pytest.mark.parametrize("action", [math.nan, -1, 11])
def test_a_manoeuvre_that_there_is_not_is_refused(home, action):
    env = make(home, actions="discrete")
    env.reset(seed=1)
    with pytest.raises(UserError, match="expected a number below 11"):
        env.unwrapped.step(action)


def test_a_copy_of_an_environment_names_the_alternative(home):
    with pytest.raises(UserError, match="an environment cannot be copied"):
        copy.deepcopy(make(home, actions="discrete"))


def test_persistent_traffic_is_that_of_evaluations(home):
    class BrakesFromTheStart:
        def reset(self, scenario):
            self.hands = Hands(scenario, "discrete")

        def act(self, observation):
            return self.hands.act(BRAKE_HARD)

    env = make(home, actions="discrete", traffic="persistent", rate_hz=20.0).unwrapped
    (_, about), *_ = driven(env, BRAKE_HARD, seed=1)
    track, conditions = env.tracks[KEY], Conditions(traffic=Traffic.PERSISTENT)
    log = run(track.case, about["ego"], BrakesFromTheStart(), conditions, track.simulation, after_contact_s=0.5)
    for evaluated, stepped in zip(log.vehicles, env._episode.log.vehicles, strict=True):
        np.testing.assert_array_equal(evaluated.x_m, stepped.x_m)


def braked_log(home):
    """The run with the same driving beside traffic that does as recorded."""
    env = make(home, actions="discrete")
    driven(env, BRAKE_HARD, seed=1)
    return env.unwrapped._episode.log


def test_an_agent_standing_in_time_has_stopped_without_progress(home):
    *steps, (_, reward, terminated, truncated, info) = driven(make(home, actions="discrete"), BRAKE_HARD, seed=1)
    assert (terminated, truncated, info["outcome"]) == (False, True, "did_not_arrive")
    assert not info["metrics"]["finished"]
    assert reward < 0.0
    driving = driven(make(home, actions="discrete"), RECORDED, seed=1)
    count = len(driving) - 2
    assert sum(step[1] for step in steps[1:][:count]) < sum(step[1] for step in driving[1:-1])


def test_the_same_seed_gives_the_same_bits_and_another_seed_other_noise(home):
    noisy = make(home, sensing=Sensing(noise_m=0.5))
    one, again, other = (driven(noisy, np.array([0.1, 0.0], np.float32), seed=seed) for seed in (7, 7, 8))
    for (seen, *said), (seen_again, *said_again) in zip(one, again, strict=True):
        assert all(np.array_equal(seen[name], seen_again[name]) for name in seen)
        assert said == said_again
    assert not np.array_equal(one[0][0]["others"], other[0][0]["others"])


def test_environments_run_in_processes_of_their_own():
    root = str(sample_runs.finished())
    apart = gymnasium.make_vec(
        trace_dag.gym.ENVIRONMENT, num_envs=2, vectorization_mode="async", home=root, key=KEY, actions="discrete"
    )
    try:
        seen, _ = apart.reset(seed=3)
        assert seen["own"].shape == (2, 6)
        np.testing.assert_array_equal(seen["route"][0], seen["route"][1])
        _, rewards, *_ = apart.step(np.array([RECORDED, BRAKE_HARD]))
        assert rewards.shape == (2,)
    finally:
        apart.close()


def test_observations_are_in_the_axes_of_the_vehicle(home):
    env = make(home)
    seen, about = env.reset(seed=1)
    episode = env.unwrapped._episode
    own = episode.moment.states[about["ego"]]
    (other,) = (state for number, state in episode.moment.states.items() if number != about["ego"])
    apart_m = np.hypot(other.x_m - own.x_m, other.y_m - own.y_m)
    assert seen["others_mask"].tolist() == [1] + [0] * 11
    assert np.hypot(*seen["others"][0, :2]) == pytest.approx(apart_m, rel=1e-5)
    assert np.hypot(*seen["others"][0, 2:4]) == pytest.approx(1.0, abs=1e-6)
    assert seen["own"][0] == pytest.approx(own.speed_mps, rel=1e-5)
    assert abs(seen["route"][0, 0] - 5.0) < 1.0, "the first point of the route is five metres ahead"


def test_reset_takes_a_crash_of_those_there_are(home):
    env = make(home, key=(), actions="discrete")
    keys = sorted(env.unwrapped.tracks)
    assert len(keys) > 1
    assert env.reset(options={"key": keys[1]})[1]["case_id"] == keys[1]
    assert {env.reset(seed=seed)[1]["case_id"] for seed in range(20)} == set(keys)
    with pytest.raises(UserError, match="no crash 2023-1"):
        env.reset(options={"key": "2023-1"})
    with pytest.raises(UserError, match="nobody drives that"):
        make(home, ego=9).reset()


def test_a_course_is_drawn_by_its_weight_and_can_be_named(home):
    env = make(home, actions="discrete", courses=True)
    weights = {each.case_id: each.weight for each in env.unwrapped.tracks.values()}
    assert sum(weights.values()) == pytest.approx(1.0)
    drawn = [chosen(env.unwrapped.tracks, None, np.random.default_rng(seed)).case_id for seed in range(400)]
    heaviest = max(weights, key=weights.get)
    assert drawn.count(heaviest) / 400 == pytest.approx(weights[heaviest], abs=0.1)  # four standard deviations
    assert env.reset(seed=3)[1]["case_id"] == env.reset(seed=3)[1]["case_id"]
    _, info = env.reset(options={"case_id": heaviest})
    assert (info["key"], info["case_id"]) == (KEY, heaviest)
    package = sample_runs.finished() / "benchmark" / "packages" / f"{KEY}.zip"
    with pytest.raises(UserError, match="of a root"):
        make(package, courses=True)


def test_a_package_is_enough(home):
    package = sample_runs.finished() / "benchmark" / "packages" / f"{KEY}.zip"
    *_, (_, _, _, _, info) = driven(make(package, actions="discrete"), RECORDED, seed=1)
    *_, (_, _, _, _, stored) = driven(make(home, actions="discrete"), RECORDED, seed=1)
    assert info["metrics"]["contact_time_s"] == pytest.approx(stored["metrics"]["contact_time_s"], abs=0.01)


def test_all_drivers_at_once_have_the_recorded_crash(home):
    env = ParallelCrashEnv(home, KEY, actions="discrete")
    _, about = env.reset(seed=1)
    assert sorted(about) == ["V1", "V2"]
    while env.agents:
        _, _, terminated, _, info = env.step(dict.fromkeys(env.agents, RECORDED))
    assert terminated == {"V1": True, "V2": True}
    assert {each["outcome"] for each in info.values()} == {"unchanged"}


def test_pictures_show_bodies_that_move_and_pages_open_at_the_end(home, monkeypatch):
    env = make(home, actions="discrete", render_mode="rgb_array")
    env.reset(seed=1)
    before = env.render()
    for _ in range(20):
        env.step(RECORDED)
    assert before.shape == (480, 480, 3)
    changed = (before != env.render()).any(axis=2).mean()
    assert 0 < changed < 0.2, "bodies are small, and only they move"
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    driven(make(home, actions="discrete", render_mode="human"), RECORDED, seed=1)
    assert [page.startswith("file://") for page in opened] == [True]
