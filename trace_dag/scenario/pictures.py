"""The picture of a crash: the road with its lanes, the paths, the bodies at contact and at rest, the reported point.

Two views of the same thing side by side: the approach (everything from the start of the reconstruction on) and the
impact (close up), north up, each with a scale bar. Values that are not known yet are left out, so a picture can be
drawn after any stage from ``road_map`` on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.crash.conditions import is_dark
from trace_dag.crash.parties import is_vehicle
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.scenario.map_scene import Window
from trace_dag.scenario.maps import MapDrawing
from trace_dag.scenario.picture_legend import outcome_line, place_line, sign_entries, vehicle_entries
from trace_dag.scenario.picture_motion import DrawnMotion, draw_reported_point
from trace_dag.scenario.picture_sheet import Sheet, around, square
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import Hypothesis, StateEstimate
from trace_dag.verdict.types import Verdict

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmFeature

WIDTH_PX: Final = 1170
"""Of the picture as pixels."""
_IMPACT_HALF_WINDOW_M: Final = 16.0
_STRIKE_HALF_WINDOW_M: Final = 8.0  # of a person, who is smaller
_FARTHEST_IMPACTS_M: Final = 40.0
_APPROACH_MARGIN_M: Final = 20.0
_LEAST_APPROACH_HALF_WINDOW_M: Final = 45.0


def draw_crash(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate | None = None,
    log: SimulationLog | None = None,
    verdict: Verdict | None = None,
    *,
    surroundings: Sequence[OsmFeature] = (),
) -> str:
    """The picture as an SVG. ``log`` is of the hypothesis that ``verdict`` names (else of the estimate's best).
    ``surroundings`` lie behind the roads.
    """
    hypothesis = _shown_hypothesis(estimate, verdict)
    sheet = Sheet()
    approach = _approach_window(hypothesis, log)
    impact = _impact_window(hypothesis, log)
    drawing = MapDrawing(
        network, around(approach, impact), surroundings=surroundings, dark=is_dark(record), fading=True
    )
    motion = DrawnMotion(hypothesis, log)
    sheet.headline(0, place_line(record))
    sheet.headline(1, outcome_line(verdict))
    for column, title, window in ((0, "Approach", approach), (1, "Impact", impact)):
        panel = sheet.panel(column, title, window)
        drawing.draw(panel)
        motion.draw(panel)
        draw_reported_point(panel, report)
    sheet.legend(vehicle_entries(record, hypothesis), sign_entries(report, hypothesis, log))
    return sheet.svg()


# --- what is shown ---------------------------------------------------------------------------------------------
def _shown_hypothesis(estimate: StateEstimate | None, verdict: Verdict | None) -> Hypothesis | None:
    if estimate is None:
        return None
    return estimate.hypotheses[verdict.hypothesis] if verdict else estimate.best


def _approach_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """A square that holds the reported point, all starts and all places of rest."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    if hypothesis:
        points += [(p.initial_pose.x_m, p.initial_pose.y_m) for p in hypothesis.participants]
    if log:
        for vehicle in log.vehicles:
            points += [(float(vehicle.x_m[i]), float(vehicle.y_m[i])) for i in (0, -1)]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    half_m = float(np.max(high - low)) / 2 + _APPROACH_MARGIN_M
    x, y = ((low + high) / 2).tolist()
    return square((x, y), max(half_m, _LEAST_APPROACH_HALF_WINDOW_M))


def _impact_window(hypothesis: Hypothesis | None, log: SimulationLog | None) -> Window:
    """A square around the first contact; if several vehicles meet, around all planned contacts that are near."""
    contact = log.first_contact if log else None
    if log is None or contact is None:
        return square(hypothesis.impact_point_xy_m if hypothesis else (0.0, 0.0), _IMPACT_HALF_WINDOW_M)
    if log.is_figure(contact.number_2):
        return square((contact.x_m, contact.y_m), _STRIKE_HALF_WINDOW_M)
    events = hypothesis.planned if hypothesis and all(is_vehicle(e.party_2) for e in hypothesis.planned) else ()
    points = np.array([(contact.x_m, contact.y_m), *(event.xy_m for event in events[1:])])
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = ((low + high) / 2).tolist()
    half_m = float(np.max(high - low)) / 2 + _IMPACT_HALF_WINDOW_M / 2
    if half_m > _FARTHEST_IMPACTS_M:
        return square((contact.x_m, contact.y_m), _IMPACT_HALF_WINDOW_M)
    return square((x, y), max(half_m, _IMPACT_HALF_WINDOW_M))
