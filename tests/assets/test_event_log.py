"""Dagster's records of a root: our event log answers what Dagster's own class answers, from files a tenth as large."""

from __future__ import annotations

import itertools
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from dagster import (
    AssetCheckEvaluation,
    AssetKey,
    AssetMaterialization,
    AssetObservation,
    DagsterEvent,
    DagsterEventType,
    DagsterInstance,
    Definitions,
    EventLogEntry,
    StaticPartitionsDefinition,
    asset,
    define_asset_job,
)
from dagster._core.definitions.freshness import FreshnessState, FreshnessStateChange
from dagster._core.events import AssetMaterializationPlannedData, AssetObservationData, StepMaterializationData
from dagster._core.storage.event_log import SqliteEventLogStorage
from sqlalchemy.exc import SQLAlchemyError

from trace_dag.assets.event_log import EventLog
from trace_dag.assets.event_packing import unpacked
from trace_dag.definitions.launch import open_instance
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace


@pytest.fixture
def instance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DagsterInstance:
    monkeypatch.setenv("DAGSTER_HOME", "to be replaced")
    monkeypatch.setenv("TRACE_DAG_ROOT", "to be replaced")
    with open_instance(Workspace.open(str(tmp_path / "root"), FLOW)) as made:
        yield made


def test_a_new_root_has_our_event_log_in_a_folder_of_its_own(instance, tmp_path):
    assert isinstance(instance.event_log_storage, EventLog)
    instance.report_runless_asset_event(AssetMaterialization("verdict", partition="2023-510179"))
    assert instance.event_log_storage.get_materialized_partitions(AssetKey("verdict")) == {"2023-510179"}
    assert (tmp_path / "root/dagster/history/packed/index.db").is_file()
    assert not (tmp_path / "root/dagster/history/runs").exists()  # Dagster's own class keeps its files there


def test_no_event_is_stored_as_plain_text(instance, tmp_path):
    instance.report_runless_asset_event(AssetMaterialization("verdict", partition="2023-510179"))
    instance.report_runless_asset_event(
        AssetCheckEvaluation(asset_key=AssetKey("verdict"), check_name="verified", passed=True, metadata={})
    )
    with closing(sqlite3.connect(tmp_path / "root/dagster/history/packed/index.db")) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        values = [each for table in tables for row in database.execute(f'SELECT * FROM "{table}"') for each in row]
    assert not [value for value in values if isinstance(value, str) and "__class__" in value]
    events = [value for value in values if isinstance(value, bytes)]
    assert len(events) == 4  # two events, the latest of the asset, the one of the check
    assert sum(map(len, events)) < 0.3 * sum(len(unpacked(value)) for value in events)


def test_a_log_of_dagsters_own_in_the_same_process_stays_plain_text(tmp_path):
    with DagsterInstance.local_temp(str(tmp_path)) as theirs:
        theirs.report_runless_asset_event(AssetMaterialization("verdict", partition="2023-510179"))
        assert theirs.fetch_materializations(AssetKey("verdict"), limit=1).records
    with closing(sqlite3.connect(tmp_path / "history/runs/index.db")) as database:
        events = [event for (event,) in database.execute("SELECT event FROM event_logs")]
    assert [event[:2] for event in events] == ['{"']


def test_an_event_that_is_damaged_is_a_damaged_database(instance, tmp_path):
    instance.report_runless_asset_event(AssetMaterialization("verdict", partition="2023-510179"))
    with closing(sqlite3.connect(tmp_path / "root/dagster/history/packed/index.db")) as database, database:
        database.execute("UPDATE event_logs SET event = x'789c00'")
    with pytest.raises(SQLAlchemyError, match="an event cannot be read"):
        instance.fetch_materializations(AssetKey("verdict"), limit=1)


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


def _as_read(log: SqliteEventLogStorage, keys: list[AssetKey]) -> dict[str, object]:
    """All that the UI asks of a log about one run and its assets."""
    return {
        "log": [entry.to_json() for entry in log.get_logs_for_run("run")],
        "assets": {
            record.asset_entry.asset_key: (record.asset_entry.last_run_id, record.asset_entry.last_materialization)
            for record in log.get_asset_records(keys)
        },
        "partitions": [log.get_materialized_partitions(key) for key in keys],
        "latest": [
            log.get_latest_storage_id_by_partition(key, kind)
            for key in keys
            for kind in (DagsterEventType.ASSET_MATERIALIZATION, DagsterEventType.ASSET_MATERIALIZATION_PLANNED)
        ],
        "tags": [log.get_event_tags_for_asset(key) for key in keys],
    }


@pytest.mark.parametrize("waiting", [False, True], ids=["as a batch", "waiting for each other"])
def test_events_are_stored_as_dagster_stores_them_one_by_one(waiting, tmp_path, monkeypatch):
    monkeypatch.setenv("DAGSTER_HOME", str(tmp_path / "home"))
    keys, partitions = [AssetKey("road_map"), AssetKey("verdict")], ["2023-510179", "2023-510180"]

    def entry(kind: DagsterEventType, number: int, data: object) -> EventLogEntry:
        event = DagsterEvent(kind.value, "job", step_key="crashes", event_specific_data=data)
        return EventLogEntry(None, 10, "", "run", 1e9 + number, "crashes", "job", event)

    events = [
        entry(DagsterEventType.RUN_START, 0, None),
        *(
            entry(
                DagsterEventType.ASSET_MATERIALIZATION_PLANNED, number, AssetMaterializationPlannedData(key, partition)
            )
            for number, (key, partition) in enumerate(itertools.product(keys, partitions), 1)
        ),
        *(
            entry(
                DagsterEventType.ASSET_MATERIALIZATION,
                number,
                StepMaterializationData(
                    AssetMaterialization(key, partition=partition, tags={"dagster/data_version": partition[-3:]})
                ),
            )
            for number, (key, partition) in enumerate(itertools.product(keys, partitions), 10)
        ),
        entry(DagsterEventType.ASSET_OBSERVATION, 18, AssetObservationData(AssetObservation(keys[0]))),
        entry(
            DagsterEventType.FRESHNESS_STATE_CHANGE,
            19,
            FreshnessStateChange(
                key=keys[1],
                new_state=FreshnessState.UNKNOWN,
                previous_state=FreshnessState.NOT_APPLICABLE,
                state_change_timestamp=1e9,
            ),
        ),
        entry(DagsterEventType.RUN_SUCCESS, 20, None),
    ]
    ours, theirs = EventLog(), SqliteEventLogStorage(str(tmp_path / "theirs"))
    if waiting:
        with ours.together():
            for each in events:
                ours.store_event(each)
    else:
        ours.store_event_batch(events)
    for each in events:
        theirs.store_event(each)
    expected = _as_read(theirs, keys)
    assert expected["partitions"] == [set(partitions)] * 2  # there is something to compare
    assert _as_read(ours, keys) == expected
    ours.dispose()


VERDICT = AssetKey("verdict")


def materialized(partition: str) -> EventLogEntry:
    data = StepMaterializationData(AssetMaterialization(VERDICT, partition=partition))
    event = DagsterEvent("ASSET_MATERIALIZATION", "job", step_key="crashes", event_specific_data=data)
    return EventLogEntry(None, 10, "", "run", 1e9, "crashes", "job", event)


def test_an_event_that_waits_for_others_is_found_at_once_and_outlasts_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("DAGSTER_HOME", str(tmp_path / "home"))
    key, log = VERDICT, EventLog()

    def stop() -> None:
        with log.together():
            log.store_event(materialized("2023-510179"))
            assert log.get_materialized_partitions(key) == {"2023-510179"}
            log.store_event(materialized("2023-510180"))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    log.dispose()
    assert EventLog().get_materialized_partitions(key) == {"2023-510179", "2023-510180"}


def test_where_a_crash_takes_long_other_processes_see_it_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("DAGSTER_HOME", str(tmp_path / "home"))
    log, seconds = EventLog(), iter([0.0, 1.0, 60.0, 60.0, 120.0, 120.0])
    monkeypatch.setattr("trace_dag.assets.event_log.monotonic", lambda: next(seconds))
    with log.together():
        log.store_event(materialized("2023-510179"))
        assert EventLog().get_materialized_partitions(VERDICT) == set()  # a second later: it waits
        log.store_event(materialized("2023-510180"))
        assert EventLog().get_materialized_partitions(VERDICT) == {"2023-510179", "2023-510180"}
        log.store_event(materialized("2023-510181"))
        assert len(EventLog().get_materialized_partitions(VERDICT)) == 3
    log.dispose()


def test_what_a_run_plans_is_written_as_one_batch(instance, monkeypatch):
    sizes = []
    stored = EventLog.store_event_batch
    monkeypatch.setattr(
        EventLog, "store_event_batch", lambda self, events: sizes.append(len(events)) or stored(self, events)
    )

    @asset(partitions_def=StaticPartitionsDefinition([str(number) for number in range(50)]))
    def thing() -> None: ...

    define = define_asset_job("one", [thing]).resolve(asset_graph=Definitions([thing]).resolve_asset_graph())
    instance.create_run_for_job(
        define, tags={"dagster/asset_partition_range_start": "0", "dagster/asset_partition_range_end": "49"}
    )
    assert max(sizes) == 50
