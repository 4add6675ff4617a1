"""An agent that learns to avoid crashes, beside every baseline: stable-baselines3's PPO, in a few minutes.

    python notebooks/train_agent.py ROOT --steps 100000 --seed 1

It learns and is measured beside persistent traffic, in which slowness avoids nothing (``--traffic``). One crash in
three is held back: chosen by a hash of its key, so that it never depends on what was learned. What is printed counts
outcomes on both parts: of the baselines, of braking hard from the first moment on, and of the agent as trained.

Needs `pip install 'trace-dag[gym]' stable-baselines3` and PyTorch.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.utils import set_random_seed

import trace_dag
from trace_dag.agents.evaluation.evaluate import Conditions, evaluate
from trace_dag.agents.evaluation.registry import BASELINES, make_agent, resolve
from trace_dag.agents.evaluation.shares import share_avoided
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.gym import ENVIRONMENT
from trace_dag.gym.single import ego_of
from trace_dag.gym.spaces import MANOEUVRES

OUTCOMES = ("conflict_avoided", "collision_avoided", "stopped", "mitigated", "unchanged", "worse")
BRAKE_HARD = next(number for number, (name, _, _) in enumerate(MANOEUVRES) if name == "brake_hard")
Run = dict[str, Any]


def held_back(key: str) -> bool:
    """Whether a crash is kept from training: one in three, by its key alone."""
    return int(hashlib.sha256(key.encode()).hexdigest(), 16) % 3 == 0


def driven(env: gymnasium.Env, key: str, choose: Callable[[Any], int]) -> Run:
    """What becomes of a crash with a policy at the wheel."""
    seen, _ = env.reset(seed=0, options={"key": key})
    over = False
    while not over:
        seen, _, terminated, truncated, info = env.step(choose(seen))
        over = terminated or truncated
    return {"key": key, "outcome": info["outcome"], "finished": info["metrics"]["finished"]}


def evaluated(env: gymnasium.Env, key: str, agent: str, conditions: Conditions) -> Run:
    """What becomes of it with an agent of the registry in the same place, as trace-dag evaluate has it."""
    track = env.unwrapped.tracks[key]
    ego = ego_of(track.case, "striking")
    found = evaluate(track.case, ego, make_agent(resolve(agent)), conditions, track.simulation)
    return {"key": key, "outcome": str(found.outcome), "finished": found.metrics.finished}


def all_runs(env: gymnasium.Env, key: str, agent: PPO, conditions: Conditions) -> dict[str, Run]:
    """What becomes of it with each driver, by name."""
    runs = {name: evaluated(env, key, name, conditions) for name in BASELINES}
    runs["brakes hard from the start"] = driven(env, key, lambda _: BRAKE_HARD)
    runs["PPO"] = driven(env, key, lambda seen: int(agent.predict(seen, deterministic=True)[0]))
    return runs


def line(who: str, runs: Sequence[Run]) -> str:
    """One line of the table."""
    counts, share = Counter(run["outcome"] for run in runs), share_avoided(runs)
    avoided = f"{share.part / share.of:4.0%} ({share.low:.0%} to {share.high:.0%})"
    finished = sum(run["finished"] for run in runs)
    return f"{who:28} {' / '.join(f'{counts[name]:3}' for name in OUTCOMES)}   {avoided:18} {finished:3} finished"


def main() -> None:
    """Train, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root")
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--traffic", choices=list(Traffic), default="persistent")
    parser.add_argument("--most", type=int, help="crashes of each part, the first ones")
    options = parser.parse_args()
    set_random_seed(options.seed)
    torch.set_num_threads(1)  # a network as small waits for threads longer than it computes
    arguments = {"home": trace_dag.open(options.root), "actions": "discrete", "traffic": options.traffic}
    env = gymnasium.make(ENVIRONMENT, **arguments)
    keys = sorted(env.unwrapped.tracks)
    parts = {
        "learned from": [key for key in keys if not held_back(key)][: options.most],
        "held back": [key for key in keys if held_back(key)][: options.most],
    }
    began_s = time.monotonic()
    vector = make_vec_env(
        ENVIRONMENT, n_envs=4, seed=options.seed, env_kwargs={**arguments, "key": parts["learned from"]}
    )
    agent = PPO("MultiInputPolicy", vector, n_steps=256, batch_size=256, ent_coef=0.01, seed=options.seed, device="cpu")
    agent.learn(options.steps)
    took_min = (time.monotonic() - began_s) / 60
    print(f"{options.steps} steps, seed {options.seed}, {options.traffic} traffic: trained in {took_min:.1f} minutes")
    conditions = Conditions(seed=options.seed, traffic=Traffic(options.traffic))
    for part, those in parts.items():
        print(f"{part}: {len(those)} crashes, the striking driver's place; {' / '.join(OUTCOMES)}; avoided (95 %)")
        runs = [all_runs(env, key, agent, conditions) for key in those]
        for who in runs[0]:
            print(line(who, [each[who] for each in runs]), flush=True)


if __name__ == "__main__":
    main()
