"""Dagster's records of a root: what our event log writes, Dagster's own class reads, and the other way round."""

from __future__ import annotations

from pathlib import Path

import pytest
from dagster import AssetKey, AssetMaterialization, DagsterInstance
from dagster._core.storage.event_log import SqliteEventLogStorage

from trace_dag.assets.event_log import EventLog
from trace_dag.assets.launch import open_instance
from trace_dag.pipeline.home import Home
from trace_dag.pipeline.stages import FLOW


@pytest.fixture
def instance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DagsterInstance:
    monkeypatch.setenv("DAGSTER_HOME", "to be replaced")
    monkeypatch.setenv("TRACE_DAG_ROOT", "to be replaced")
    with open_instance(Home(str(tmp_path / "root"), FLOW)) as made:
        yield made


def test_a_new_root_has_our_event_log_where_dagster_keeps_its_own(instance, tmp_path):
    assert isinstance(instance.event_log_storage, EventLog)
    instance.report_runless_asset_event(AssetMaterialization("verdict", partition="2023-510179"))
    folder = tmp_path / "root/dagster/history/runs"
    assert (folder / "index.db").is_file()
    theirs = SqliteEventLogStorage(str(folder))
    assert theirs.get_materialized_partitions(AssetKey("verdict")) == {"2023-510179"}
    theirs.wipe_asset(AssetKey("verdict"))
    assert not instance.event_log_storage.get_materialized_partitions(AssetKey("verdict"))


def test_few_files_stay_open_and_a_deleted_one_is_made_again(instance):
    log = instance.event_log_storage
    runs = [f"run-{number}" for number in range(20)]
    for run in runs:
        with log.run_connection(run) as connection:
            connection.exec_driver_sql("SELECT count(*) FROM event_logs")
    opened = [link for link in Path("/proc/self/fd").iterdir() if "/run-" in str(link.resolve())]
    assert len({str(link.resolve()).removesuffix("-wal").removesuffix("-shm") for link in opened}) < 10
    for leftover in Path(log.path_for_shard(runs[-1])).parent.glob(f"{runs[-1]}.db*"):
        leftover.unlink()
    assert not log.get_logs_for_run(runs[-1])
