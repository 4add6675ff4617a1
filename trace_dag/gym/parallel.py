"""The environment of every driver of a crash at once, for PettingZoo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
from pettingzoo import ParallelEnv

from trace_dag.agents.evaluation.observation import Sensing
from trace_dag.gym.episode import Reward
from trace_dag.gym.pool import Place, tracks
from trace_dag.gym.single import OneEpisode, RenderMode, chosen, drivers_of, period_of
from trace_dag.gym.spaces import ActionKind, Seen, action_space, observation_space


class ParallelCrashEnv(OneEpisode, ParallelEnv[str, Seen, Any]):  # type: ignore[misc] # PettingZoo has no types
    """Every driver of one verified crash, each an agent: ``V1``, ``V2``, ... by the vehicle's number in the report.

    People and parked vehicles follow the recording. The other arguments, observations, actions, the reward and the end
    are those of :class:`trace_dag.gym.single.CrashEnv`; an episode ends for all at once.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "trace_dag/Crash-v0",
        "render_modes": ["rgb_array", "human"],
        "is_parallelizable": True,
    }

    def __init__(
        self,
        home: Place | None,
        key: str,
        *,
        variations: bool = False,
        courses: bool = False,
        actions: ActionKind = "continuous",
        rate_hz: float = 10.0,
        sensing: Sensing | None = None,
        reward: Reward | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        period_s = period_of(rate_hz)
        found = tracks(home, [key], variations=variations, courses=courses)
        super().__init__(found, period_s, actions, sensing, reward, render_mode)
        case = next(iter(found.values())).case
        self.possible_agents = [f"V{number}" for number in drivers_of(case)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(actions) for agent in self.possible_agents}
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> gymnasium.spaces.Space[Any]:
        """See :meth:`pettingzoo.ParallelEnv.observation_space`."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Space[Any]:
        """See :meth:`pettingzoo.ParallelEnv.action_space`."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Seen], dict[str, dict[str, Any]]]:
        """See :meth:`pettingzoo.ParallelEnv.reset`; ``options`` as :class:`trace_dag.gym.single.CrashEnv` takes."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        track = chosen(self.tracks, options, self._random)
        self.close()
        self._begin(track, drivers_of(track.case), self._random)
        self.agents = [f"V{driver.ego}" for driver in self._drivers]
        seen, infos = zip(*(driver.look() for driver in self._drivers), strict=True)
        return dict(zip(self.agents, seen, strict=True)), dict(zip(self.agents, infos, strict=True))

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """See :meth:`pettingzoo.ParallelEnv.step`."""
        agents = [f"V{driver.ego}" for driver in self._drivers]
        steps = dict(zip(agents, self._go_on([actions[agent] for agent in agents]), strict=True))
        if self._running().over:
            self.agents = []
        return (
            {agent: seen for agent, (seen, *_) in steps.items()},
            {agent: reward for agent, (_, reward, *_) in steps.items()},
            {agent: terminated for agent, (_, _, terminated, *_) in steps.items()},
            {agent: truncated for agent, (*_, truncated, _) in steps.items()},
            {agent: info for agent, (*_, info) in steps.items()},
        )
