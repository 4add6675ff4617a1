"""A crash as an ensemble: unreported quantities as weighted courses, in which an agent can drive.

The draws of an estimate are weighed by the report (:mod:`trace_dag.reconstruction.samples.simulated`).
:func:`likely_draws` takes at most :data:`MOST_COURSES` of them, :func:`draw_course` makes the plans of one from the
beginning of the recorded crash. An agent's result in a crash is then a probability (the warehouse's view
``agent_probabilities``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trace_dag.reconstruction.samples.crash import SampledCrash
from trace_dag.reconstruction.samples.simulated import SampledRuns
from trace_dag.scenario.cases import BEYOND_IMPACT_S
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import Hypothesis, StateEstimate
from trace_dag.simulation.types import Participant

MOST_COURSES = 20


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
