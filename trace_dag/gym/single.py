"""The environment of one driver: ``gymnasium.make("trace_dag/Crash-v0", home=..., key=..., ego=...)``."""

from __future__ import annotations

import tempfile
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal, NoReturn

import gymnasium
import numpy as np
from numpy.typing import NDArray

from trace_dag.agents.evaluation.metrics import measure, outcome_of
from trace_dag.agents.evaluation.observation import Sensing
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.stored_cases import AgentRole, number_of
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import Pose
from trace_dag.flow.artefacts import RECORD
from trace_dag.gym.episode import Episode, EpisodeMoment, Reward
from trace_dag.gym.pool import Place, Track, tracks
from trace_dag.gym.spaces import ActionKind, Eyes, Hands, LanePoints, Seen, action_space, observation_space
from trace_dag.pages.animation import View
from trace_dag.pages.picture_motion import SampledBody, draw_body
from trace_dag.pages.replay import replay_page
from trace_dag.pages.replay_content import replay_content, replay_windows
from trace_dag.scenario.cases import Case
from trace_dag.scenario.drawn_shapes import body_colour
from trace_dag.scenario.progress import RecordedWay
from trace_dag.simulation.types import SimulationLog

RenderMode = Literal["rgb_array", "human"]
_SEEDS = 2**31


class EpisodeDriver:
    """One driver of an episode: its observations, its actions, and its progress along the recorded distance."""

    def __init__(self, episode: Episode, ego: int, lanes: LanePoints, actions: ActionKind, reward: Reward) -> None:
        scenario = episode.scenario(ego)
        self.ego = ego
        self.hands = Hands(scenario, actions)
        self._eyes = Eyes(scenario, lanes)
        self._episode = episode
        self._reward = reward
        self._period_s = scenario.period_s
        self._driven_m = 0.0
        self._recorded_m = RecordedWay(episode.case, ego).at(episode.case.end_s)

    def look(self) -> tuple[Seen, dict[str, Any]]:
        """Return the observation and the ``info`` now."""
        case, moment = self._episode.case, self._episode.moment
        assert moment is not None
        light, light_m = case.light_ahead(self.ego, moment.states[self.ego], moment.time_s)
        info = {"key": case.key, "case_id": case.case_id, "ego": self.ego, "light": light, "light_m": light_m}
        return self._eyes.as_seen(self._episode.observe(self.ego)), info

    def rewarded(self) -> tuple[float, dict[str, Any]]:
        """Return the reward of the last step, and what the run adds to ``info`` once it has ended."""
        assert self._episode.moment is not None
        state, before_m = self._episode.moment.states[self.ego], self._driven_m
        self._driven_m += max(state.speed_mps, 0.0) * self._period_s
        reward = self._reward.on_the_way(self._driven_m, before_m, self._recorded_m)
        if self._episode.log is None:
            return reward, {}
        metrics = measure(self._episode.case, self.ego, self._episode.log)
        in_the_end = {"outcome": str(outcome_of(metrics)), "metrics": asdict(metrics)}
        return reward + self._reward.in_the_end(metrics), in_the_end


class OneEpisode:
    """Common to the environments: the crashes to choose from, and the current episode, at most one."""

    def __init__(
        self,
        tracks: Mapping[str, Track],
        period_s: float,
        actions: ActionKind,
        sensing: Sensing | None,
        reward: Reward | None,
        render_mode: RenderMode | None,
        traffic: Traffic = Traffic.RECORDED,
    ) -> None:
        self.tracks = tracks
        self.render_mode: str | None = render_mode
        self._period_s = period_s
        self._actions = actions
        self._sensing = sensing or Sensing()
        self._reward = reward or Reward()
        self._traffic = traffic
        self._episode: Episode | None = None
        self._drivers: list[EpisodeDriver] = []
        self._camera: Camera | None = None

    def close(self) -> None:
        """Abandon the episode."""
        if self._episode is not None:
            self._episode.close()

    def render(self) -> Any:
        """Return a picture of the present moment for ``rgb_array``; ``human`` shows whole episodes by itself."""
        if self.render_mode != "rgb_array":
            return None
        episode = self._running()
        assert episode.moment is not None
        if self._camera is None or self._camera.case_id != episode.case.case_id:
            self._camera = Camera(episode.case)
        return self._camera.picture(episode.moment)

    def __deepcopy__(self, memo: dict[int, Any]) -> NoReturn:
        raise UserError(
            "an environment cannot be copied: its simulation runs in a thread of its own; make another one with the "
            "same arguments, reset it with the same seed and options, and repeat the actions"
        )

    def _begin(self, track: Track, egos: Sequence[int], random: np.random.Generator) -> None:
        """Begin an episode with some drivers."""
        self._track = track
        self._episode = Episode(
            track.case,
            tuple(egos),
            track.simulation,
            period_s=self._period_s,
            sensing=self._sensing,
            seed=int(random.integers(_SEEDS)),
            traffic=self._traffic,
        )
        self._drivers = [EpisodeDriver(self._episode, ego, track.lanes, self._actions, self._reward) for ego in egos]

    def _go_on(self, actions: Sequence[Any]) -> list[tuple[Seen, float, bool, bool, dict[str, Any]]]:
        """Continue with an action of each driver; return what a step returns, for each."""
        if self._running().over:
            raise UserError("the episode is over; reset begins another one")
        episode = self._running()
        acting = zip(self._drivers, actions, strict=True)
        episode.step({driver.ego: driver.hands.act(action) for driver, action in acting})
        touched = episode.log is not None and episode.log.first_contact is not None
        if episode.log is not None and self.render_mode == "human":
            show_page(self._track, episode.log)
        steps = []
        for driver in self._drivers:
            (reward, in_the_end), (seen, info) = driver.rewarded(), driver.look()
            steps.append((seen, reward, touched, episode.over and not touched, in_the_end | info))
        return steps

    def _running(self) -> Episode:
        if self._episode is None:
            raise UserError("no episode has begun; call reset first")
        return self._episode


def period_of(rate_hz: float) -> float:
    """Return the time between two steps, s.

    Raises :class:`UserError` for a rate out of bounds.
    """
    if not 1.0 <= rate_hz <= 100.0:
        raise UserError(f"rate_hz {rate_hz:g}: expected 1 to 100 steps a second")
    return 1.0 / rate_hz


class CrashEnv(OneEpisode, gymnasium.Env[Seen, Any]):
    """An agent at the wheel of one vehicle of a verified crash.

    The others follow the recording until they are hit, keep their distance (``traffic="reactive"``), or keep the
    conflict with the agent (``traffic="persistent"``).

    Args: home: a storage root, a package or a release, or what ``trace_dag.open`` gave; the default of
    ``trace_dag.open`` if left out. key: one crash or several; all crashes between parties by default. ego: the place
    that the agent takes, a value of ``trace-dag evaluate --ego`` or a vehicle's number. variations: include the stored
    variations of the crashes. courses: use the likely courses of each crash in its place, drawn by their weights.
    actions: ``continuous`` or ``discrete``; see :mod:`trace_dag.gym.spaces`. rate_hz: steps per second, 1 to 100.
    sensing: range, noise and occlusion of its sight. traffic: motion of the others, a value of ``trace-dag evaluate
    --traffic``. reward: weights; see :class:`trace_dag.gym.episode.Reward`. render_mode: ``rgb_array``, or ``human``:
    the replay of each episode as a page in the browser.

    ``reset(seed=..., options={"key": ..., "case_id": ...})`` chooses a crash, or one variation or course. The seed
    draws one of the remaining ones: crashes and variations with equal probability, courses by their weights. The same
    seed, options and actions give the same bits. An episode is terminated by the first contact between any parties. It
    is truncated when the agent has arrived 50 m beyond the conflict or at the end of its recorded way (but not before
    five seconds after the recorded impact), or has taken twice the recorded time. ``info`` has the crash's ``key``, the
    ``case_id`` (the variation's id for a variation), ``ego``, and the next light on the way straight on: ``light``,
    red, yellow or green, and ``light_m``, the way to its stop line; None without one. In the end it also has the
    ``outcome`` and all ``metrics``. Raises :class:`trace_dag.common.errors.UserError` for a
    crash, case or place that is missing.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}  # noqa: RUF012 - as its base

    def __init__(
        self,
        home: Place | None = None,
        key: str | Sequence[str] = (),
        ego: str | int = "striking",
        *,
        variations: bool = False,
        courses: bool = False,
        actions: ActionKind = "continuous",
        rate_hz: float = 10.0,
        sensing: Sensing | None = None,
        traffic: Literal["recorded", "reactive", "persistent", "surrounding"] = "recorded",
        reward: Reward | None = None,
        render_mode: RenderMode | None = None,
    ) -> None:
        period_s = period_of(rate_hz)
        if traffic not in list(Traffic):
            raise UserError(f"traffic {traffic!r}: expected {', '.join(Traffic)}")
        others, keys = Traffic(traffic), [key] if isinstance(key, str) else list(key)
        found = tracks(home, keys, variations=variations, courses=courses, traffic=others)
        super().__init__(found, period_s, actions, sensing, reward, render_mode, others)
        self.observation_space = observation_space()
        self.action_space = action_space(actions)
        self.metadata = {**self.metadata, "render_fps": round(rate_hz)}
        self._ego = ego

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """See :meth:`gymnasium.Env.reset`."""
        super().reset(seed=seed)
        track = chosen(self.tracks, options, self.np_random)
        self.close()
        self._begin(track, [ego_of(track.case, self._ego)], self.np_random)
        return self._drivers[0].look()

    def step(self, action: Any) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """See :meth:`gymnasium.Env.step`."""
        return self._go_on([action])[0]


def chosen(tracks: Mapping[str, Track], options: Mapping[str, Any] | None, random: np.random.Generator) -> Track:
    """Return the case that ``options`` name, or one drawn by weight among those that they allow.

    Other options are ignored.

    Raises :class:`UserError` for an unknown crash.
    """
    asked = options or {}
    case_id, key = asked.get("case_id"), asked.get("key")
    left = [
        each
        for each in tracks.values()
        if (case_id is None or each.case_id == case_id) and (key is None or each.key == key)
    ]
    if not left:
        raise UserError(f"reset: no crash {case_id or key} among the {len(tracks)} of this environment")
    weights = np.array([each.weight for each in left])
    return left[int(random.choice(len(left), p=weights / weights.sum()))]


def ego_of(case: Case, ego: str | int) -> int:
    """Return the number of the vehicle in a role, or of that number.

    Raises :class:`UserError` for a party that drives no vehicle.
    """
    if isinstance(ego, str):
        try:
            return number_of(case, AgentRole(ego))
        except ValueError as error:
            raise UserError(f"ego {ego!r}: expected {', '.join(AgentRole)}, or a vehicle's number") from error
    if ego not in drivers_of(case):
        raise UserError(f"ego {ego}: nobody drives that in {case.case_id}; drivers are {drivers_of(case)}")
    return ego


def drivers_of(case: Case) -> list[int]:
    """Return the numbers of the vehicles with a driver."""
    return [each.number for each in case.participants if not each.body.is_figure and each.number not in case.parked]


# --- pictures --------------------------------------------------------------------------------------------------------
_SIZE_PX = 480


class Camera:
    """A view of one case from above that covers all positions of the recorded crash."""

    def __init__(self, case: Case) -> None:
        self.case_id = case.case_id
        self._view = View(case.network, replay_windows(case.recorded).overview, _SIZE_PX)
        self._bodies = case.bodies

    def picture(self, moment: EpisodeMoment) -> NDArray[np.uint8]:
        """Return the bodies at a moment, shape (480, 480, 3)."""
        canvas = self._view.canvas()
        for number, body in self._bodies.items():
            state = moment.states[number]
            pose = Pose(state.x_m, state.y_m, state.heading_rad)
            colour = body_colour(number, self._bodies)
            draw_body(canvas, SampledBody(pose, body.length_m, body.width_m, colour, 1.0))
        return np.asarray(self._view.picture(canvas), np.uint8)


def show_page(track: Track, log: SimulationLog) -> Path:
    """Write a run as a page, open it in a browser, and return its path."""
    page = replay_page(replay_content(track.crash.load(RECORD), track.case.network, log))
    with tempfile.NamedTemporaryFile(prefix=f"crash-{track.case_id}-", suffix=".html", delete=False) as file:
        file.write(page)
    webbrowser.open(Path(file.name).as_uri())
    return Path(file.name)
