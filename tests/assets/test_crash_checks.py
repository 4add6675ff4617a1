"""Each crash's own check: what it says of a partition, and that it follows what is done to it again."""

from __future__ import annotations

from collections.abc import Mapping

from dagster import AssetCheckKey, AssetKey, DagsterRunStatus

from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage
from trace_dag.flow.selection import select_again

KEYS = [f"2023-5100{number:02}" for number in range(1, 5)]
VERIFIED = AssetCheckKey(AssetKey("verdict"), "verified")


def stands(campaign, check: AssetCheckKey) -> Mapping[str, str]:
    """What the last evaluation says, by partition."""
    infos = campaign.instance.event_log_storage.get_asset_check_partition_info([check])
    return {info.partition_key: info.latest_execution_status.value for info in infos}


def test_every_crash_has_its_own_evaluation(campaign):
    made = campaign(dict(zip(KEYS, ["", "reject:road_map", "reject:verdict", "reject:osm_extract"], strict=True)))
    made.run()
    passed, failed = "SUCCEEDED", "FAILED"
    assert stands(made, VERIFIED) == dict(zip(KEYS, [passed, failed, failed, failed], strict=True))


def test_the_reason_of_every_rejected_crash_stands_with_its_outcome(campaign):
    made = campaign(dict(zip(KEYS[:2], ["reject:road_map", "reject:osm_extract"], strict=True)))
    made.run()
    history = made.instance.event_log_storage.get_asset_check_execution_history(VERIFIED, limit=10)
    assert {record.partition: record.evaluation.metadata["reason"].value for record in history} == {
        KEYS[0]: Reason.CRASH_OFF_ROAD.value,
        KEYS[1]: Reason.NO_MAP_COVERAGE.value,
    }


def test_a_run_does_not_miss_the_checks_it_has_evaluated(campaign):
    made = campaign({KEYS[0]: "", KEYS[1]: "reject:osm_extract"})
    made.run()
    (run,) = made.instance.get_runs()
    assert run.status is DagsterRunStatus.SUCCESS
    said = [entry.message for entry in made.instance.all_logs(run.run_id)]
    assert not [line for line in said if "did not yield" in line]


def test_a_failed_check_warns_with_reason_and_sentence(campaign):
    made = campaign({KEYS[0]: "reject:verdict"})
    made.run()
    (record,) = made.instance.event_log_storage.get_asset_check_execution_history(VERIFIED, limit=1)
    assert record.partition == KEYS[0]
    assert record.evaluation.severity.value == "WARN"
    assert record.evaluation.metadata["reason"].value == "wrong_location"
    assert "7 m" in record.evaluation.description


def test_a_crash_run_again_is_checked_again_and_no_other(campaign):
    made = campaign(dict.fromkeys(KEYS[:2], ""))
    made.run()
    made.run(select_again(made.workspace, only=[KEYS[1]], first=Stage.VERDICT))
    assert set(stands(made, VERIFIED).values()) == {"SUCCEEDED"}
    history = made.instance.event_log_storage.get_asset_check_execution_history(VERIFIED, limit=10)
    assert sorted(record.partition for record in history) == [KEYS[0], KEYS[1], KEYS[1]]
