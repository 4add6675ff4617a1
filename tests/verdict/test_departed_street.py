"""The street that a vehicle left, beside those that the report names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.states.test_departures import TREE, judged_crash, left_road
from tests.verdict.crashes import STREET
from trace_dag.errors import Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.verdict.departed_street import DepartedStreet, departed_street, street_criterion

ELM, OAK = "Elm Street", "Oak Avenue"


@pytest.mark.parametrize(
    ("left", "reported", "near", "held"),
    [
        (ELM, ("ELM ST", ""), (ELM, OAK), True),
        (OAK, ("ELM ST", ""), (ELM, OAK), False),
        (OAK, ("ELM ST", "OAK AVE"), (ELM, OAK), True),
        (OAK, ("ELM ST", ""), (OAK,), None),  # the reported street is not on the map there
        (OAK, ("", ""), (ELM, OAK), None),
        (OAK, ("SR-12", ""), (ELM, OAK), None),  # a number cannot be held against a name
    ],
)
def test_a_motion_along_a_street_that_is_not_reported_is_none_of_the_report(
    left: str, reported: tuple[str, str], near: tuple[str, ...], held: bool | None
) -> None:
    crash = replace(left_road(TREE), trafficway_1=reported[0], trafficway_2=reported[1])
    found = street_criterion(DepartedStreet(frozenset({left}), frozenset(near)), crash, 1, 2)
    assert found.passed is held
    assert found.reason is Reason.WRONG_LOCATION
    assert (OAK in found.detail) is (held is False)


def test_the_street_is_that_under_the_vehicle_before_it_leaves() -> None:
    named = RoadNetwork(STREET.frame, tuple(replace(road, names=(ELM,)) for road in STREET.roads))
    log = judged_crash(left_road(TREE)).log
    [driven] = log.vehicles
    assert log.first_contact is not None
    assert departed_street(named, driven, log.first_contact.time_s).names == {ELM}
    beside = replace(driven, y_m=np.full_like(driven.y_m, 50.0))
    assert departed_street(named, beside, log.first_contact.time_s).names == frozenset()
