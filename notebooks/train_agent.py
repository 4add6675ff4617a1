"""An agent that learns to avoid crashes, beside the `brake` baseline: stable-baselines3's PPO, in a few minutes.

    python notebooks/train_agent.py ROOT --steps 100000 --seed 1

One crash in three is held back: chosen by a hash of its key, so that it never depends on what was learned. What is
printed counts outcomes on both parts, of the agent as trained, of the baseline, of the recorded drivers, and of braking
hard from the first moment on, which avoids most crashes by not driving.

Needs `pip install 'trace-dag[gym]' stable-baselines3` and PyTorch.
"""

from __future__ import annotations

import argparse
import hashlib
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.utils import set_random_seed

import trace_dag
from trace_dag.evaluation.evaluate import Conditions, evaluate
from trace_dag.evaluation.registry import make_agent, resolve
from trace_dag.gym import ENVIRONMENT
from trace_dag.gym.acting import MANOEUVRES

OUTCOMES = ("conflict_avoided", "collision_avoided", "stopped", "mitigated", "unchanged", "worse")
NUMBER = {name: number for number, (name, _, _) in enumerate(MANOEUVRES)}


def held_back(key: str) -> bool:
    """Whether a crash is kept from training: one in three, by its key alone."""
    return int(hashlib.sha256(key.encode()).hexdigest(), 16) % 3 == 0


def driven(env: gymnasium.Env, keys: Iterable[str], choose: Callable[[Any], int]) -> tuple[Counter, float]:
    """Outcomes of a policy, and the mean share of the recorded way that it drove."""
    outcomes: Counter = Counter()
    shares = []
    for key in keys:
        seen, _ = env.reset(seed=0, options={"key": key})
        over, rewards = False, 0.0
        while not over:
            seen, reward, terminated, truncated, info = env.step(choose(seen))
            over = terminated or truncated
            rewards += reward if not over else 0.0
        outcomes[info["outcome"]] += 1
        shares.append(rewards / 0.5)  # the weight of progress
    return outcomes, float(np.mean(shares))


def baseline(env: gymnasium.Env, keys: Iterable[str], agent: str, seed: int) -> Counter:
    """Outcomes of an agent of the registry in the same places, as trace-dag evaluate has them."""
    outcomes: Counter = Counter()
    for key in keys:
        track = env.unwrapped.tracks[key]
        _, about = env.reset(seed=0, options={"key": key})
        made = make_agent(resolve(agent))
        outcomes[str(evaluate(track.case, about["ego"], made, Conditions(seed=seed), track.simulation).outcome)] += 1
    return outcomes


def told(who: str, outcomes: Counter, share: float | None = None) -> None:
    """One line of the table."""
    counts = " / ".join(str(outcomes[name]) for name in OUTCOMES)
    print(f"{who:28} {counts:>20}" + (f"   drove {share:.0%} of the way" if share is not None else ""), flush=True)


def main() -> None:
    """Train, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root")
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most", type=int, help="crashes of each part, the first ones")
    options = parser.parse_args()
    set_random_seed(options.seed)
    home = trace_dag.open(options.root)
    every = sorted(gymnasium.make(ENVIRONMENT, home=home, actions="discrete").unwrapped.tracks)
    parts = {
        "training": [key for key in every if not held_back(key)][: options.most],
        "held back": [key for key in every if held_back(key)][: options.most],
    }
    arguments = {"home": home, "key": parts["training"], "actions": "discrete"}
    vector = make_vec_env(ENVIRONMENT, n_envs=4, seed=options.seed, env_kwargs=arguments)
    agent = PPO("MultiInputPolicy", vector, n_steps=256, batch_size=256, ent_coef=0.01, seed=options.seed, device="cpu")
    agent.learn(options.steps)
    for part, keys in parts.items():
        env = gymnasium.make(ENVIRONMENT, home=home, key=keys, actions="discrete")
        print(f"{part}: {len(keys)} crashes, the striking driver's place; {' / '.join(OUTCOMES)}")
        told("recorded driver", *driven(env, keys, lambda seen: NUMBER["recorded"]))
        told("brake baseline", baseline(env, keys, "brake", options.seed))
        told("brakes hard from the start", *driven(env, keys, lambda seen: NUMBER["brake_hard"]))
        learned = driven(env, keys, lambda seen: int(agent.predict(seen, deterministic=True)[0]))
        told(f"PPO, {options.steps} steps, seed {options.seed}", *learned)


if __name__ == "__main__":
    main()
