"""What everybody was going to do: trailers follow whoever pulls them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.agents.cases import case
from tests.simulation.motions import driven, participant, straight
from tests.simulation.test_towing import combination
from tests.verdict.crashes import STREET
from trace_dag.crash.codes.bodies import BODIES
from trace_dag.scenario.drives import STEP_S, course_of, drives_of

RADIUS_M, SPEED_MPS = 20.0, 5.0
AT = 200  # steps: most of a circle


def test_a_trailer_goes_on_behind_whoever_pulls_it() -> None:
    """In a steady turn the trailer's axle runs at the root of the hitch's radius squared less the drawbar squared (WHI
    formula, SAE J695)."""
    until_s = 1.9 * math.pi * RADIUS_M / SPEED_MPS
    turn = driven(0.0, 0.0, 0.0, lambda _: SPEED_MPS, lambda _: 1 / RADIUS_M, until_s=until_s)
    pulls = combination(BODIES["tractor_of_trailer"], turn)
    stands = participant(2, straight(200.0, 0.0, 0.0, 0.0, until_s=7.0))
    puller, _, towed = drives_of(case(STREET, pulls, stands, impact_time_s=until_s - 5.0))
    assert (towed.number, towed.is_driven, towed.participant.body.is_trailer) == (3001, False, True)
    assert len(towed.course) == len(puller.course)
    trailer = pulls.trailer
    assert trailer is not None
    x, y, _, heading, speed = towed.course[AT]
    back_m = trailer.axle_m - trailer.length_m / 2
    hitch_x, hitch_y = trailer.hitch(tuple(puller.course[AT, (0, 1, 3)]), pulls.body.length_m)
    expected_m = math.sqrt(math.hypot(hitch_x, hitch_y - RADIUS_M) ** 2 - trailer.drawbar_m**2)
    axle_m = math.hypot(x - back_m * math.cos(heading), y - back_m * math.sin(heading) - RADIUS_M)
    assert axle_m == pytest.approx(expected_m, abs=0.1)
    assert speed == pytest.approx(SPEED_MPS * expected_m / RADIUS_M, rel=0.02)
    # It starts where it was, in line.
    assert np.hypot(*towed.course[0, :2]) == pytest.approx(
        trailer.hitch_m - pulls.body.length_m / 2 + trailer.length_m / 2 - trailer.coupling_m
    )


def test_one_that_skids_goes_on_as_it_moved_last_at_its_speed_over_the_ground() -> None:
    """Sideways from 2 s on, when the speed along its heading is nothing; its plan ends at 3 s."""
    planned = straight(0.0, 0.0, 0.0, 20.0, until_s=3.0)
    sideways = planned.time_s >= 2.0
    spun = replace(
        planned,
        heading_rad=np.where(sideways, math.pi / 2, 0.0),
        speed_mps=np.where(sideways, 0.0, planned.speed_mps),
    )
    skids = replace(participant(1, spun), skids_from_s=2.0)
    course = course_of(skids, 8.0)
    times = np.arange(0.0, 8.05, STEP_S)
    np.testing.assert_allclose(course[:, 0], 20.0 * times, atol=1e-6)
    np.testing.assert_allclose(course[:, 4], 20.0, atol=1e-6)
    np.testing.assert_allclose(course[times > 2.05, 3], math.pi / 2)
