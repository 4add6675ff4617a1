"""A crash during a run, from above: a picture for ``rgb_array``, a page for ``human``."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import Pose
from trace_dag.flow.artefacts import RECORD
from trace_dag.gym.episode import EpisodeMoment
from trace_dag.gym.pool import Track
from trace_dag.pages.animation import View
from trace_dag.pages.picture_motion import SampledBody, draw_body
from trace_dag.pages.replay import write_html_player
from trace_dag.pages.replay_content import replay_windows
from trace_dag.scenario.cases import Case
from trace_dag.scenario.drawn_shapes import body_colour
from trace_dag.simulation.types import SimulationLog

_SIZE_PX = 480


class Camera:
    """A view of one case from above that covers all positions of the recorded crash."""

    def __init__(self, case: Case) -> None:
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
    page = write_html_player(track.crash.load(RECORD), track.case.network, log)
    with tempfile.NamedTemporaryFile(prefix=f"crash-{track.case_id}-", suffix=".html", delete=False) as file:
        file.write(page)
    webbrowser.open(Path(file.name).as_uri())
    return Path(file.name)
