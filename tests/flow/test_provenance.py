"""Fingerprints and outcome records."""

from __future__ import annotations

from dataclasses import replace

import pytest

from trace_dag.common.errors import Failure, Reason
from trace_dag.common.provenance import (
    Outcome,
    OutcomeRecord,
    Provenance,
    record_from_json,
    record_to_json,
    settings_of,
)
from trace_dag.common.settings import SimSettings
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import StoredFile

MADE_OF = Provenance("0.1.0+abc", {"step_s": 0.005}, {"road_map.xodr": "12ab"}, {"mujoco": "3.3.1"})
RECORD = OutcomeRecord(
    key="2023-510179",
    stage=Stage.ROAD_MAP,
    outcome=Outcome.REJECTED,
    provenance=MADE_OF,
    fingerprint=MADE_OF.fingerprint,
    run_id="r1",
    started_at="2026-01-01T00:00:00.000+00:00",
    duration_s=0.25,
    reason=Reason.CRASH_OFF_ROAD,
    detail="The nearest road is 31 m away.",
    measured=31.0,
    threshold=30.0,
    artefacts=(StoredFile("road_map/2023-510179.json", 10, "ff"),),
    figures={"roads": 3, "converter": "native"},
)


def test_record_survives_storage():
    assert record_from_json(record_to_json(RECORD), name=RECORD.name) == RECORD


def test_half_a_record_is_none():
    with pytest.raises(Failure, match=r"road_map/x\.outcome\.json: damaged: not a JSON object"):
        record_from_json(record_to_json(RECORD)[:40], name="road_map/x.outcome.json")


@pytest.mark.parametrize(
    "other",
    [
        replace(MADE_OF, code="0.1.0+abd"),
        replace(MADE_OF, libraries={"mujoco": "3.3.2"}),
        replace(MADE_OF, settings={"step_s": 0.004}),
        replace(MADE_OF, inputs={"road_map.xodr": "12ac"}),
        replace(MADE_OF, inputs={"road_map.json": "12ab"}),
    ],
)
def test_fingerprint_changes_with_every_part(other):
    assert other.fingerprint != MADE_OF.fingerprint


def test_fingerprint_does_not_depend_on_order():
    one = replace(MADE_OF, inputs={"a": "1", "b": "2"})
    assert one.fingerprint == replace(MADE_OF, inputs={"b": "2", "a": "1"}).fingerprint


def test_fields_that_say_how_a_service_is_reached_are_no_part_of_it():
    assert settings_of(SimSettings(carla_port=2002)) == settings_of(SimSettings())
    assert settings_of(SimSettings(friction=0.5)) != settings_of(SimSettings())


def test_history_keeps_the_latest_twenty_finished_outcomes():
    record = RECORD
    for number in range(30):
        started = replace(RECORD, outcome=Outcome.STARTED, artefacts=()).superseding(record)
        record = replace(RECORD, run_id=f"r{number + 2}").superseding(started)
    assert [past.run_id for past in record.history] == [f"r{number}" for number in range(11, 31)]
