"""Files of a package for driving tools: ``lanes.json``, ``courses.json`` and ``ensemble.json``.

The first has every drivable lane as points, with the lanes after and beside it. The second has the motion of every
party and trailer without the crash. The third has the same for other likely courses of the parties, with their weights.
Numbers are rounded to the centimetre (and a thousandth of a radian).

An ensemble has the unreported quantities of a crash as weighted courses, in which an agent can drive. The draws of an
estimate are weighed by the report (:mod:`trace_dag.reconstruction.samples.simulated`). :func:`likely_draws` takes at
most :data:`MOST_COURSES` of them, :func:`draw_course` makes the plans of one from the beginning of the recorded crash.
An agent's result in a crash is then a probability (the warehouse's view ``agent_probabilities``).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.crash.parties import party_label, party_of_body
from trace_dag.reconstruction.samples.crash import SampledCrash
from trace_dag.reconstruction.samples.simulated import SampledRuns
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.cases import BEYOND_IMPACT_S
from trace_dag.scenario.drives import (
    COURSE_COLUMNS,
    GOAL_HEADING_RAD,
    GOAL_LENGTH_M,
    GOAL_WIDTH_M,
    STEP_S,
    Drive,
    Goal,
    course_of,
)
from trace_dag.scenario.polylines import worth_keeping
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import Hypothesis, StateEstimate
from trace_dag.simulation.types import Participant

_AS_GOOD_AS_M: Final = 0.05  # borders are simplified; nowhere are they farther than this from the map's
_DECIMALS: Final = {"heading_rad": 3}
_FRAME: Final = "x east, y north of the reported point, z up, metres; headings counter-clockwise from east, radians"
_LANES: Final = {
    "id": "road, lane section and lane of map.xodr",
    "type": "as OpenDRIVE has it; bidirectional is a lane for turning that both directions use",
    "speed_mps": "speed limit, m/s; null where the map has none",
    "junction_id": "the junction of map.xodr it is in; null outside",
    "left_m, right_m": "its borders in its direction of travel, x, y; its centre is half-way between "
    "points of one number",
    "z_m": "height at each of these points",
    "successors": "the lanes after it, in its direction of travel; it is a predecessor of these",
    "left, right": "the lane directly beside it, and whether its traffic goes the same way",
}
_COURSES: Final = {
    "pulled_by": "of a trailer: the party that pulls it; null of parties",
    "stands": "whether it is parked: nobody drives it, and its course is where it stands",
    "course": "where its middle would have been without the crash, every step_s from the start, and its speed, m/s",
    "route": "the lanes of lanes.json along which it was going; none where it starts in no lane",
    "goal": "of drivers: the rectangle to be reached, around its middle, along its heading; when, in seconds from the "
    "start; how far the heading may be off",
}

_ENSEMBLE: Final = {
    "draw": "its number among the draws of states.json",
    "weight": "how often it is taken, of all courses together 1",
    "impact_s": "when the parties are planned to meet, from the start",
    "friction": "of tyres on the road, as a multiple of the crash's",
    "parties": "as in courses.json, without routes and goals",
}
MOST_COURSES = 20


def lane_id(ref: LaneRef) -> str:
    """Return a lane's name in ``lanes.json`` and in other formats.

    >>> lane_id(LaneRef("12", 0, -1))
    '12.0.-1'
    """
    return f"{ref.road_id}.{ref.section}.{ref.lane_id}"


def lanes_to_json(key: str, network: RoadNetwork) -> bytes:
    """Return the drivable lanes as UTF-8 JSON; equal maps give equal bytes."""
    shapes = [shape for shape in lane_shapes(network, drivable_only=True) if shape.length_m > 0.0]
    known = {shape.ref for shape in shapes}
    kept = worth_keeping([(shape.left_m, shape.right_m) for shape in shapes], _AS_GOOD_AS_M)
    document = {
        "key": key,
        "frame": _FRAME,
        "proj": network.frame.proj,
        "attribution": network.attribution,
        "columns": _LANES,
        "lanes": [_lane(shape, points, known) for shape, points in zip(shapes, kept, strict=True)],
    }
    return _json(document)


def courses_to_json(key: str, drives: Sequence[Drive]) -> bytes:
    """Return the motions of all parties without the crash, as UTF-8 JSON.

    Equal crashes give equal bytes.

    >>> json.loads(courses_to_json("2023-319003", []))["parties"]  # nobody moved
    {}
    """
    document = {
        "key": key,
        "frame": _FRAME,
        "step_s": STEP_S,
        "columns": _COURSES,
        "parties": {str(drive.number): _party(drive) for drive in drives},
    }
    return _json(document)


def ensemble_to_json(key: str, estimate: StateEstimate, sampled: SampledRuns) -> bytes:
    """Return the likely courses of a crash without its collision, the heaviest first, as UTF-8 JSON.

    Equal crashes give equal bytes.
    """
    courses = [(sample, weight, draw_course(estimate, sample)) for sample, weight in likely_draws(sampled)]
    document = {
        "key": key,
        "frame": _FRAME,
        "step_s": STEP_S,
        "columns": _ENSEMBLE,
        "courses": [
            {
                "draw": sample,
                "weight": weight,
                "impact_s": round(course.impact_time_s, 3),
                "friction": course.friction,
                "parties": {
                    str(each.number): _course(course_of(each, course.impact_time_s + BEYOND_IMPACT_S))
                    for each in course.participants
                },
            }
            for sample, weight, course in courses
        ],
    }
    return _json(document)


def _course(course: FloatArray) -> dict[str, Any]:
    columns = zip(COURSE_COLUMNS, course.T, strict=True)
    return {name: _rounded(values, _DECIMALS.get(name, 2)) for name, values in columns}


def _lane(shape: LaneShape, kept: list[int], known: set[LaneRef]) -> dict[str, Any]:
    """Return a lane with only the kept points of its borders."""

    def beside(ref: LaneRef | None, same_way: bool) -> dict[str, Any] | None:
        return {"id": lane_id(ref), "same_way": same_way} if ref in known and ref is not None else None

    return {
        "id": lane_id(shape.ref),
        "type": str(shape.type),
        "speed_mps": None if shape.speed_mps is None else round(shape.speed_mps, 2),
        "junction_id": shape.junction_id,
        "left_m": _rounded(shape.left_m[kept, :2]),
        "right_m": _rounded(shape.right_m[kept, :2]),
        "z_m": _rounded(shape.left_m[kept, 2]),
        "successors": [lane_id(ref) for ref in shape.successors if ref in known],
        "left": beside(shape.left, shape.left_same_way),
        "right": beside(shape.right, shape.right_same_way),
    }


def _rounded(values: FloatArray, decimals: int = 2) -> Any:
    return (values.round(decimals) + 0.0).tolist()


def _party(drive: Drive) -> dict[str, Any]:
    party = party_of_body(drive.number)
    course = drive.course[:1] if drive.is_parked else drive.course
    return {
        "name": party_label(drive.number),
        "pulled_by": None if party == drive.number else str(party),
        "stands": drive.is_parked,
        "course": _course(course),
        "route": None if drive.route is None else [lane_id(ref) for ref in drive.route.lanes],
        "goal": None if drive.goal is None else _goal(drive.goal),
    }


def _goal(goal: Goal) -> dict[str, float]:
    return {
        "x_m": round(goal.pose.x_m, 2),
        "y_m": round(goal.pose.y_m, 2),
        "heading_rad": round(goal.pose.heading_rad, 3),
        "length_m": GOAL_LENGTH_M,
        "width_m": GOAL_WIDTH_M,
        "within_rad": GOAL_HEADING_RAD,
        "from_s": round(goal.from_s, 2),
        "to_s": round(goal.to_s, 2),
    }


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, ensure_ascii=False, separators=(",", ":")) + "\n").encode()


# --- ensembles -------------------------------------------------------------------------------------------------------
class DrawnCourse(NamedTuple):
    """A draw as a course: hypothesis, plans, objects, planned time of impact (s), and friction.

    Friction is a multiple of the crash's.
    """

    hypothesis: Hypothesis
    participants: tuple[Participant, ...]
    objects: tuple[FixedObject, ...]
    impact_time_s: float
    friction: float


def likely_draws(sampled: SampledRuns, most: int = MOST_COURSES) -> list[tuple[int, float]]:
    """Return draws by their index among the estimate's, the heaviest first, with weights that sum to 1.

    They come from systematic resampling (Kitagawa, Journal of Computational and Graphical Statistics 5, 1996): ``most``
    evenly spaced points on the weights laid end to end, so that a draw is taken in proportion to its weight, without
    chance.
    """
    if not sampled.contacts:
        return []
    ends = np.cumsum([contact.weight for contact in sampled.contacts])
    points = (np.arange(most) + 0.5) / most * ends[-1]
    chosen, counts = np.unique(np.searchsorted(ends, points), return_counts=True)
    found = [(sampled.contacts[k].sample, float(n) / most) for k, n in zip(chosen, counts, strict=True)]
    return sorted(found, key=lambda each: (-each[1], each[0]))


def draw_course(estimate: StateEstimate, sample: int) -> DrawnCourse:
    """Return the course of a draw with a contact; it begins as long before the impact as the crash."""
    draw = estimate.samples[sample]
    hypothesis = estimate.hypotheses[draw.hypothesis]
    crash = SampledCrash.of(hypothesis, draw)
    assert crash is not None, "a draw that touches somebody was simulated"
    before_s = max(hypothesis.impact_time_s, crash.back_s)
    plans = crash.participants(BEYOND_IMPACT_S, before_s=before_s)
    return DrawnCourse(hypothesis, plans, crash.objects, before_s, draw.friction)
