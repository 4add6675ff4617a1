"""Contacts beside the pairs that are to touch: in their turn, again, out of turn, never."""

from __future__ import annotations

import pytest

from trace_dag.geometry import Pose
from trace_dag.sim.order import comes_in_order, in_order
from trace_dag.sim.types import Contact

HERE = Pose(0.0, 0.0, 0.0)


def contacts(*pairs: tuple[int, int]) -> list[Contact]:
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


CHAIN = [(1, 2), (2, 3), (3, 4)]


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
def test_contacts_in_their_turn(happened: list[tuple[int, int]], matched: list[int | None], strange: list[int]) -> None:
    found = in_order(contacts(*happened), CHAIN)
    assert [contact and contact.time_s for contact in found.matched] == matched
    assert [contact.time_s for contact in found.strange] == strange
    assert found.happened == sum(second is not None for second in matched)
    assert comes_in_order(contacts(*happened), CHAIN) == (not strange)


def test_contacts_are_put_in_the_order_of_time() -> None:
    found = in_order(contacts((1, 2), (2, 3), (3, 4))[::-1], CHAIN)
    assert [contact and contact.time_s for contact in found.matched] == [1, 2, 3]


def test_a_pair_that_is_to_meet_twice_has_to() -> None:
    twice = [(1, 2), (1, 3), (1, 2)]
    assert in_order(contacts((1, 2), (1, 2), (1, 3)), twice).happened == 2
    assert in_order(contacts((1, 2), (1, 3), (1, 2)), twice).happened == 3


def test_where_no_order_is_told_any_will_do() -> None:
    found = in_order(contacts((3, 4), (1, 2), (2, 3)), CHAIN, told=False)
    assert [contact and contact.time_s for contact in found.matched] == [2, 3, 1]
    assert found.strange == ()
    assert len(in_order(contacts((3, 4), (1, 5)), CHAIN, told=False).strange) == 1
    assert comes_in_order(contacts((3, 4), (1, 2)), CHAIN, told=False)
    assert not comes_in_order(contacts((3, 4), (1, 5)), CHAIN, told=False)
