"""No site is in two parts, the same crashes are always split alike, and the parts have about their shares."""

from __future__ import annotations

import math
from collections import Counter

from trace_dag.agents.evaluation.splits import SITE_M, Split, splits_of

METRE_DEG = 1.0 / 111_195.0  # of latitude, on a sphere of 6,371 km


def test_crashes_within_a_kilometre_are_in_one_part_by_way_of_others_too():
    chain = {f"2020-{number}": (35.0 + number * 900.0 * METRE_DEG, -100.0) for number in range(60)}
    assert len(set(splits_of(chain).values())) == 1


def test_a_kilometre_is_one_in_every_direction():
    for latitude in (25.0, 48.0):
        east_deg = METRE_DEG / math.cos(math.radians(latitude))
        for step, one in ((0.99 * SITE_M, True), (1.01 * SITE_M, False)):
            places = {f"2020-{n}": (latitude, -100.0 + n * step * east_deg) for n in range(60)}
            assert (len(set(splits_of(places).values())) == 1) is one


def test_a_crash_elsewhere_moves_no_other_and_order_does_not_matter():
    places = {f"2020-{number}": (30.0 + number * 0.1, -90.0) for number in range(50)}
    before = splits_of(places)
    assert splits_of(dict(reversed(places.items()))) == before
    after = splits_of(places | {"2021-1": (60.0, -150.0)})
    assert {key: after[key] for key in before} == before


def test_parts_have_about_their_shares():
    places = {f"2020-{number}": (30.0 + number * 0.02, -90.0) for number in range(2000)}
    parts = Counter(splits_of(places).values())
    for part, share in ((Split.TRAIN, 0.6), (Split.VALIDATION, 0.2), (Split.TEST, 0.2)):
        assert abs(parts[part] / 2000 - share) < 0.05  # more than four standard deviations
    assert splits_of({}) == {}
