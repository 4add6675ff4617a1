"""Speed of the environments for learning, beside highway-env in the same run: simulated seconds per second.

    python -m benchmarks.environments ROOT

Both act at 10 Hz and do nothing (the recorded driver goes on; highway-env's IDLE), on one core, by processor time, by
turns; loading a crash is not counted, resetting is. ROOT is a storage root, a package or a release. Without highway-env
(pip install highway-env) ours stand alone.
"""

from __future__ import annotations

import importlib.util
import statistics
import sys
import time
from collections.abc import Callable, Sequence

import gymnasium

import trace_dag
from trace_dag.gym import ENVIRONMENT
from trace_dag.gym.acting import MANOEUVRES

_ROUNDS, _EPISODES, _HZ = 5, 6, 10.0
_NULL = next(number for number, (name, _, _) in enumerate(MANOEUVRES) if name == "recorded")


def rate(env: gymnasium.Env, action: int, options: Sequence[dict[str, str] | None]) -> float:
    """Simulated seconds per second of processor time over an episode for each of the options."""
    began, steps = time.process_time(), 0
    for seed, option in enumerate(options):
        env.reset(seed=seed, options=option)
        over = False
        while not over:
            *_, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
            steps += 1
    return steps / _HZ / (time.process_time() - began)


def peers() -> dict[str, Callable[[], float]]:
    """highway-env's two scenes that are nearest to crashes, at the same rate."""
    if importlib.util.find_spec("highway_env") is None:
        return {}
    import highway_env

    highway_env._register_highway_envs()
    config = {"policy_frequency": 10, "simulation_frequency": 20, "duration": 60}
    found = {}
    for name in ("highway-fast-v0", "intersection-v0"):
        env = gymnasium.make(name, config=config)
        found[f"highway-env {name}"] = lambda env=env: rate(env, 1, [None] * _EPISODES)
    return found


def main() -> None:
    """Print the median of several rounds of each."""
    ours = gymnasium.make(ENVIRONMENT, home=trace_dag.open(sys.argv[1]), actions="discrete")
    keys = sorted(ours.unwrapped.tracks)[: 3 * _EPISODES : 3]
    for key in keys:
        ours.reset(options={"key": key})
    chosen = [{"key": key} for key in keys]
    suites = {f"{ENVIRONMENT}, {len(keys)} crashes": lambda: rate(ours, _NULL, chosen), **peers()}
    found: dict[str, list[float]] = {name: [] for name in suites}
    for _ in range(_ROUNDS):
        for name, suite in suites.items():
            found[name].append(suite())
    for name, rates in found.items():
        print(f"{name:40} {statistics.median(rates):6.0f} times real time ({min(rates):.0f} to {max(rates):.0f})")


if __name__ == "__main__":
    main()
