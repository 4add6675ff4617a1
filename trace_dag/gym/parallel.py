"""The environment of every driver of a crash at once, for PettingZoo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np
from pettingzoo import ParallelEnv

from trace_dag.agents.evaluation.observation import Sensing
from trace_dag.gym.episode import Episode, Reward
from trace_dag.gym.pool import Place, tracks
from trace_dag.gym.single import Camera, EpisodeDriver, OneEpisode, about, chosen, drivers_of, period_of, show_page
from trace_dag.gym.spaces import ActionKind, Seen, action_space, observation_space

_SEEDS = 2**31


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
        render_mode: Literal["rgb_array", "human"] | None = None,
    ) -> None:
        self._period_s = period_of(rate_hz)
        self.tracks = tracks(home, [key], variations=variations, courses=courses)
        self.render_mode = render_mode
        case = next(iter(self.tracks.values())).case
        self.possible_agents = [f"V{number}" for number in drivers_of(case)]
        self.agents: list[str] = []
        self.observation_spaces = {agent: observation_space() for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(actions) for agent in self.possible_agents}
        self._actions: ActionKind = actions
        self._sensing = sensing or Sensing()
        self._reward = reward or Reward()
        self._random = np.random.default_rng()
        self._drivers: dict[str, EpisodeDriver] = {}
        self._camera: Camera | None = None

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
        self._track = track
        numbers = drivers_of(track.case)
        self._episode = Episode(
            track.case,
            tuple(numbers),
            track.simulation,
            period_s=self._period_s,
            sensing=self._sensing,
            seed=int(self._random.integers(_SEEDS)),
        )
        self._drivers = {
            f"V{number}": EpisodeDriver(self._episode, number, track.lanes, self._actions, self._reward)
            for number in numbers
        }
        self.agents = list(self._drivers)
        infos = {agent: about(self._episode, driver.ego) for agent, driver in self._drivers.items()}
        return {agent: driver.look() for agent, driver in self._drivers.items()}, infos

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """See :meth:`pettingzoo.ParallelEnv.step`."""
        episode = self._unfinished()
        episode.step({driver.ego: driver.hands.act(actions[agent]) for agent, driver in self._drivers.items()})
        touched = episode.log is not None and episode.log.first_contact is not None
        rewarded = {agent: driver.rewarded() for agent, driver in self._drivers.items()}
        seen = {agent: driver.look() for agent, driver in self._drivers.items()}
        if episode.log is not None:
            self.agents = []
            if self.render_mode == "human":
                show_page(self._track, episode.log)
        return (
            seen,
            {agent: reward for agent, (reward, _) in rewarded.items()},
            dict.fromkeys(rewarded, touched),
            dict.fromkeys(rewarded, episode.log is not None and not touched),
            {agent: info | about(episode, self._drivers[agent].ego) for agent, (_, info) in rewarded.items()},
        )

    def render(self) -> Any:
        """See :meth:`trace_dag.gym.single.CrashEnv.render`."""
        if self.render_mode != "rgb_array":
            return None
        episode = self._running()
        assert episode.moment is not None
        self._camera = self._camera or Camera(episode.case)
        return self._camera.picture(episode.moment)
