"""What happens beside what is reported: in its turn, again, out of turn, never."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.motions import log_of, meeting
from trace_dag.common.geometry import Pose
from trace_dag.simulation.matching import Expected, Pair, SimulatedEvent, happenings, happenings_of, match
from trace_dag.simulation.types import Contact

HERE = Pose(0.0, 0.0, 0.0)


def contacts(*pairs: Pair) -> list[Contact]:
    """Contacts of these pairs, one a second."""
    return [
        Contact(
            time_s=float(second),
            duration_s=0.1,
            x_m=0.0,
            y_m=0.0,
            z_m=0.0,
            normal_x=1.0,
            normal_y=0.0,
            impulse_ns=1.0,
            closing_speed_mps=1.0,
            number_1=one,
            number_2=two,
            pose_1=HERE,
            pose_2=HERE,
            velocity_1_mps=(0.0, 0.0),
            velocity_2_mps=(0.0, 0.0),
            delta_v_1_mps=(0.0, 0.0),
            delta_v_2_mps=(0.0, 0.0),
        )
        for second, (one, two) in enumerate(pairs, start=1)
    ]


def seconds(found: tuple[SimulatedEvent | None, ...]) -> list[float | None]:
    return [each and each.time_s for each in found]


CHAIN = [Expected((1, 2)), Expected((2, 3)), Expected((3, 4))]
CURB, POLE, OVER = (1, 2002), (1, 2003), (1, 1)
STRUCK, LATER_POLE, LATER_OVERTURN = Expected((1, 2)), Expected(POLE, required=False), Expected(OVER, required=False)


@pytest.mark.parametrize(
    ("happened", "matched", "strange"),
    [
        ([(1, 2), (2, 3), (3, 4)], [1, 2, 3], []),
        ([(2, 1), (3, 2), (4, 3)], [1, 2, 3], []),  # whoever comes first in a contact
        ([(1, 2), (2, 3), (1, 2), (2, 3), (3, 4)], [1, 2, 5], []),  # those that have met lie against each other
        ([(1, 2), (3, 4), (2, 3)], [1, 3, None], [2]),  # two swapped
        ([(1, 2), (3, 4)], [1, None, None], [2]),  # one missing
        ([(1, 2), (2, 3), (3, 4), (1, 5)], [1, 2, 3], [4]),  # one too many
        ([], [None, None, None], []),
    ],
)
def test_required_events_come_in_order(happened: list[Pair], matched: list[int | None], strange: list[int]) -> None:
    found = match(happenings(contacts(*happened)), CHAIN)
    assert seconds(found.matched) == matched
    assert seconds(found.strange) == strange
    assert found.happened == sum(second is not None for second in matched)


@pytest.mark.parametrize(
    ("happened", "matched", "strange"),
    [
        ([(1, 2), POLE, (1, 3)], [1, 2, 3], []),
        ([(1, 2), (1, 3)], [1, None, 2], []),  # what is left out takes nothing from what follows
        ([POLE, (1, 2), (1, 3)], [2, None, 3], [1]),  # too early
        ([(1, 2), (1, 3), POLE], [1, None, 2], []),  # too late
        ([(1, 2), CURB, (1, 3)], [1, None, 3], [2]),  # an object that is not reported
    ],
)
def test_an_object_may_be_left_out(happened: list[Pair], matched: list[int | None], strange: list[int]) -> None:
    found = match(happenings(contacts(*happened)), [STRUCK, LATER_POLE, Expected((1, 3))])
    assert seconds(found.matched) == matched
    assert seconds(found.strange) == strange


def test_overturns_are_matched_in_their_turn_and_are_never_strange() -> None:
    overturns = SimulatedEvent(1.5, OVER)
    struck, pole = happenings(contacts((1, 2), POLE))
    seen = [struck, overturns, pole]
    assert match(seen, [STRUCK, LATER_OVERTURN, LATER_POLE]).matched == (struck, overturns, pole)
    assert match(seen, [STRUCK, LATER_POLE, LATER_OVERTURN]).matched == (struck, None, overturns)  # the pole is late
    assert match(seen, [STRUCK, LATER_POLE]).strange == ()


def test_events_are_in_the_order_of_time() -> None:
    found = match(happenings(contacts((1, 2), (2, 3), (3, 4))[::-1]), CHAIN)
    assert seconds(found.matched) == [1, 2, 3]


def test_a_pair_that_is_to_meet_twice_has_to() -> None:
    twice = [Expected((1, 2)), Expected((1, 3)), Expected((1, 2))]
    assert match(happenings(contacts((1, 2), (1, 2), (1, 3))), twice).happened == 2
    assert match(happenings(contacts((1, 2), (1, 3), (1, 2))), twice).happened == 3


def test_any_order_holds_without_a_reported_one() -> None:
    found = match(happenings(contacts((3, 4), (1, 2), (2, 3))), CHAIN, order_known=False)
    assert seconds(found.matched) == [2, 3, 1]
    assert found.strange == ()
    assert seconds(match(happenings(contacts((3, 4), (1, 5))), CHAIN, order_known=False).strange) == [2]
    free = match(happenings(contacts(POLE, (2, 3), (1, 2))), [STRUCK, LATER_POLE, Expected((2, 3))], order_known=False)
    assert seconds(free.matched) == [3, 1, 2]
    assert free.strange == ()


def test_a_simulation_shows_contacts_and_vehicles_that_overturn() -> None:
    """Of two cars that meet head on, one lies on its roof at last."""
    log = log_of(meeting(np.pi, 10.0, 10.0))
    (touch,) = [each for each in happenings_of(log) if each.contact is not None][:1]
    one, two = log.parties
    over_s = (touch.time_s + two.time_s[-1]) / 2
    rolls = np.where(two.time_s >= over_s, np.pi, 0.0)
    found = happenings_of(replace(log, vehicles=(one, replace(two, roll_rad=rolls))))
    assert [each.pair for each in happenings_of(log) if each.contact is None] == []
    (overturn,) = [each for each in found if each.contact is None]
    assert (touch.pair, overturn.pair) == ((1, 2), (2, 2))
    assert overturn.time_s == pytest.approx(over_s, abs=0.1)
    assert [each.time_s for each in found] == sorted(each.time_s for each in found)


@pytest.mark.parametrize(
    ("happened", "matched"),
    [
        ([(1, 2), (1, 1), (3, 3)], [1, 3, 2]),  # of two vehicles either may overturn first
        ([(1, 2), (3, 3), (1, 1)], [1, 2, 3]),
        ([(1, 2), (1, 4), (3, 3)], [1, 3, 2]),  # after a contact of others that is reported later
        ([(3, 3), (1, 2), (1, 1)], [2, None, 3]),  # before the contact it follows
    ],
)
def test_events_of_other_parties_that_may_be_left_out_come_in_any_order(
    happened: list[Pair], matched: list[float | None]
) -> None:
    last = Expected((1, 4)) if (1, 4) in happened else Expected((1, 1), required=False)
    expected = [Expected((1, 2)), Expected((3, 3), required=False), last]
    seen = [SimulatedEvent(float(second), pair) for second, pair in enumerate(happened, start=1)]
    assert seconds(match(seen, expected).matched) == matched


def test_an_event_of_a_vehicle_before_its_own_earlier_one_does_not_count() -> None:
    """Overturned before the pole it is reported to strike first: only what comes in its turn happens."""
    expected = [Expected((1, 2)), LATER_POLE, LATER_OVERTURN]
    seen = [SimulatedEvent(1.0, (1, 2)), SimulatedEvent(2.0, OVER), SimulatedEvent(3.0, POLE)]
    assert seconds(match(seen, expected).matched) == [1.0, None, 2.0]
