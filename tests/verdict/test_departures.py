"""What the verdict says of a departure from the road beside whether it is as reported."""

from __future__ import annotations

from dataclasses import replace

from example_objects import record_of

from trace_dag.crash.departures import departure_of
from trace_dag.settings import VerdictSettings
from trace_dag.verdict.departures import departing


def test_where_the_first_harm_was_on_the_roadway_no_side_is_judged_and_that_is_why() -> None:
    record = record_of("tree_record")
    departure = replace(departure_of(record), side=None)
    for code, why in ((1, "the first harmful event was on the roadway"), (4, "the report does not say to which side")):
        found = departing(None, (), None, departure, replace(record, road_relation_code=code), VerdictSettings())
        (side,) = (criterion for criterion in found if criterion.name == "departure_side")
        assert (side.passed, side.detail) == (None, why)
