"""What runs together: selections cut into contiguous ranges."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.common.stage import Stage
from trace_dag.flow.selection import Selection, plan, plan_maps_first

KEYS = [f"2023-5100{number:02d}" for number in range(10, 50)]
STAGES = list(Stage)


@st.composite
def selections(draw: st.DrawFn) -> Selection:
    asked = draw(st.lists(st.sampled_from(KEYS), unique=True, min_size=1))
    stale = draw(st.lists(st.sampled_from(asked), unique=True))
    start = {key: draw(st.sampled_from(STAGES)) for key in stale}
    return Selection(tuple(asked), start, exact=draw(st.booleans()))


@given(selections(), st.integers(1, 12))
def test_every_stale_crash_runs_once_from_its_stage_and_no_other_is_touched(selection, size):
    batches = plan(KEYS, selection, size=size)
    ran = [key for batch in batches for key in batch.keys]
    assert len(ran) == len(set(ran))
    assert set(selection.start) <= set(ran) <= set(selection.asked)
    for batch in batches:
        first = KEYS.index(batch.keys[0])
        assert list(batch.keys) == KEYS[first : first + len(batch.keys)], "a run covers one contiguous range"
        assert len(batch.keys) <= size
        assert batch.stages == batch.stages[0].and_later()
        for key in batch.keys:
            if key in selection.start:
                assert selection.start[key].position >= batch.stages[0].position
            if selection.exact:
                assert selection.start[key] is batch.stages[0]
        if selection.exact:
            assert batch.force == {batch.stages[0]}


def test_crashes_between_are_taken_along_to_spare_runs():
    start = {KEYS[0]: Stage.VERDICT, KEYS[4]: Stage.ROAD_MAP}
    (batch,) = plan(KEYS, Selection(tuple(KEYS), start), size=250)
    assert (batch.keys, batch.stages[0]) == (tuple(KEYS[:5]), Stage.ROAD_MAP)
    assert len(plan(KEYS, Selection(tuple(start), start), size=250)) == 2
    assert len(plan(KEYS, Selection(tuple(KEYS), start, exact=True), size=250)) == 2


@pytest.mark.parametrize("selection", [Selection(tuple(KEYS)), Selection(())])
def test_nothing_stale_is_nothing_to_run(selection):
    assert plan(KEYS, selection, size=10) == []


def test_maps_first_gets_all_crashes_to_their_extract_in_one_run():
    start = {KEYS[0]: Stage.RAW_REPORT, KEYS[1]: Stage.OSM_EXTRACT, KEYS[2]: Stage.VERDICT, KEYS[3]: Stage.RAW_REPORT}
    batches = plan_maps_first(KEYS, Selection(tuple(KEYS), start), size=2)
    assert [(batch.keys, batch.stages[0], batch.stages[-1]) for batch in batches] == [
        (tuple(KEYS[:4]), Stage.RAW_REPORT, Stage.OSM_EXTRACT),
        (tuple(KEYS[:2]), Stage.ROAD_MAP, Stage.VERDICT),
        (tuple(KEYS[2:4]), Stage.ROAD_MAP, Stage.VERDICT),
    ]


def test_a_run_is_of_one_register():
    partitions = ["2023-510010", "2023-510011", "montgomery-A1", "tempe-1", "tempe-2"]
    selection = Selection(tuple(partitions), dict.fromkeys(partitions, Stage.ROAD_MAP))
    batches = [batch.keys for batch in plan(partitions, selection, size=10)]
    assert batches == [("2023-510010", "2023-510011"), ("montgomery-A1",), ("tempe-1", "tempe-2")]
