"""Dagster's records against what is stored: what a killed run did not get to say is found, and said."""

from __future__ import annotations

from dataclasses import replace

from dagster import AssetKey, AssetRecordsFilter

from trace_dag.assets.verify import repair_dagster, verify_dagster
from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.registry import ReportSource
from trace_dag.flow.records import read_records, write_record
from trace_dag.flow.verify import DisagreementKind

GOOD, REJECTED, FAILED = "2023-510001", "2023-510002", "2023-510003"
BEHAVIOURS = {GOOD: "", REJECTED: "reject:road_map", FAILED: "fail-once:state_estimate"}


def look(made):
    records = read_records(made.workspace.storage, made.workspace.registry.keys())
    return records, verify_dagster(made.instance, records)


def repaired(made):
    records, found = look(made)
    repair_dagster(made.instance, made.workspace.storage, records, found)
    return look(made)[1]


def found_of(found):
    return {(each.kind, each.key, each.stage) for each in found}


def test_after_a_run_dagster_names_what_is_stored(campaign):
    made = campaign(BEHAVIOURS)
    made.run()
    assert look(made)[1] == []


def test_results_of_a_run_that_could_not_log_them_are_reported_with_their_outcome(campaign):
    made = campaign({GOOD: "", REJECTED: "reject:road_map"})
    list(run_stages(made.workspace, [GOOD, REJECTED], run_id="killed before it said anything"))
    expected = {(DisagreementKind.NOT_LOGGED, key, stage) for key in (GOOD, REJECTED) for stage in Stage}
    assert found_of(look(made)[1]) == expected
    assert repaired(made) == []
    assert set(made.statuses().values()) == {"MATERIALIZED"}
    (event,) = made.instance.fetch_materializations(
        AssetRecordsFilter(AssetKey("verdict"), asset_partitions=[REJECTED]), limit=1
    ).records
    metadata = event.asset_materialization.metadata
    assert (metadata["outcome"].value, metadata["stage_reached"].value) == ("rejected", "road_map")


def test_an_earlier_result_is_not_taken_for_the_present_one(campaign):
    made = campaign({GOOD: ""})
    made.run()
    changed = made.workspace.with_settings({"sim": {"friction": 0.4}, "execution": {"executor": "in_process"}})
    list(run_stages(changed, [GOOD], run_id="killed before it said anything"))
    assert found_of(look(made)[1]) == {(DisagreementKind.NOT_LOGGED, GOOD, Stage.SIMULATION_LOG)}
    assert repaired(made) == []


def test_a_failure_shown_as_an_earlier_success_is_named(campaign):
    made = campaign({FAILED: ""})
    made.run()
    record = read_records(made.workspace.storage, [FAILED])[FAILED][Stage.SIMULATION_LOG]
    write_record(made.workspace.storage, replace(record, outcome=Outcome.FAILED, artefacts=()))
    later = Stage.SIMULATION_LOG.and_later()
    assert found_of(look(made)[1]) == {(DisagreementKind.FAILURE_NOT_LOGGED, FAILED, stage) for stage in later}


def test_a_result_that_is_gone_is_named(campaign):
    made = campaign({GOOD: ""})
    made.run()
    made.workspace.storage.delete(f"verdict/{GOOD}.outcome.json")
    assert found_of(look(made)[1]) == {(DisagreementKind.NO_RESULT, GOOD, Stage.VERDICT)}
    made.run()
    assert look(made)[1] == []


def test_partitions_follow_the_registered_crashes(campaign):
    made = campaign({GOOD: "", REJECTED: "reject:road_map"})
    made.run()
    made.workspace.registry.register("more", {"2023-510009": ReportSource("file", "/not/run", "0")})
    made.workspace.registry.remove("fakes", [REJECTED])
    assert found_of(look(made)[1]) == {
        (DisagreementKind.NO_PARTITION, "2023-510009", None),
        (DisagreementKind.STRAY_PARTITION, REJECTED, None),
    }
    assert repaired(made) == []
    assert list(made.instance.get_dynamic_partitions("crashes")) == [GOOD, "2023-510009"]
