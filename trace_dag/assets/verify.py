"""Comparison of Dagster's records with the stored ones, and their completion.

A process may end between storing a result and logging it, or before its run logs the failures. Each materialization has
the fingerprint of its record as data version, so that one query per stage compares them all.
"""

from collections.abc import Iterable, Iterator, Mapping

from dagster import AssetKey, AssetMaterialization, DagsterEventType, DagsterInstance

from trace_dag.assets.run_requests import CRASHES, add_partitions, remove_partitions
from trace_dag.assets.specs import DATA_VERSION, data_version, materialization
from trace_dag.common.messages.progress import OnProgress, silent
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.crash_status import crash_status, valid_records
from trace_dag.flow.records import Records
from trace_dag.flow.tasks import Action, StageEvent
from trace_dag.flow.verify import Disagreement, DisagreementKind

_MATERIALIZED, _FAILED = "MATERIALIZED", "FAILED"


def verify_dagster(instance: DagsterInstance, records: Mapping[str, Records]) -> list[Disagreement]:
    """Compare partitions with registered crashes, and Dagster's materialization of each stage with its record."""
    partitions = instance.get_dynamic_partitions("crashes")
    known = set(partitions)
    found = [
        Disagreement(DisagreementKind.NO_PARTITION, "it is registered and Dagster has no partition for it", key)
        for key in records
        if key not in known
    ]
    found += [
        Disagreement(DisagreementKind.STRAY_PARTITION, "Dagster has a partition for it and it is not registered", key)
        for key in partitions
        if key not in records
    ]
    told = {key: last_word(of_crash) for key, of_crash in records.items()}
    outdated = {key: crash_status(key, of_crash).outdated for key, of_crash in records.items()}
    for stage in Stage:
        status = instance.get_status_by_partition(AssetKey(stage.value), partitions, CRASHES) or {}
        versions = instance.event_log_storage.get_latest_tags_by_partition(
            AssetKey(stage.value), DagsterEventType.ASSET_MATERIALIZATION, [DATA_VERSION]
        )
        for key in records:
            held = status.get(key)
            shown = held.value if held is not None else "missing"
            version = versions.get(key, {}).get(DATA_VERSION)
            since = outdated[key]
            if since is not None and stage.position >= since.position and shown == _FAILED:
                continue  # of the new attempt, which failed; the earlier result stands
            found += _of_stage(key, stage, told[key].get(stage), shown, version)
    return found


def repair_dagster(
    instance: DagsterInstance,
    storage: Storage,
    records: Mapping[str, Records],
    disagreements: Iterable[Disagreement],
    on_progress: OnProgress = silent,
) -> None:
    """Add and remove partitions, and log missing materializations.

    If Dagster's folder was lost, or the root came from another machine, these are all of them. ``on_progress`` receives
    the numbers done and in total.
    """
    wrong = list(disagreements)
    add_partitions(instance, [each.key for each in wrong if each.kind is DisagreementKind.NO_PARTITION and each.key])
    remove_partitions(
        instance, {each.key for each in wrong if each.kind is DisagreementKind.STRAY_PARTITION and each.key}
    )
    unlogged = [
        (each.key, each.stage) for each in wrong if each.kind is DisagreementKind.NOT_LOGGED and each.key and each.stage
    ]
    told = {key: last_word(records[key]) for key in {key for key, _ in unlogged}}
    for done, (key, stage) in enumerate(unlogged, 1):
        record = told[key].get(stage)
        if record is not None:
            instance.report_runless_asset_event(_materialization(key, stage, record, storage))
        on_progress(done, len(unlogged))


def last_word(records: Records) -> dict[Stage, OutcomeRecord]:
    """Return, for each stage, the record that Dagster should show.

    It is the stage's own record, or that of the earlier stage that ended the crash.
    """
    told: dict[Stage, OutcomeRecord] = {}
    valid, ended = valid_records(records), None
    for stage in Stage:
        record = ended or valid.get(stage)
        if record is None:
            break
        told[stage] = record
        if record.outcome is not Outcome.ACCEPTED:
            ended = record
    return told


def _of_stage(
    key: str, stage: Stage, record: OutcomeRecord | None, shown: str, version: str | None
) -> Iterator[Disagreement]:
    if record is None:
        if shown == _MATERIALIZED:
            yield Disagreement(DisagreementKind.NO_RESULT, "Dagster shows a result and none is stored", key, stage)
    elif record.outcome is Outcome.FAILED:
        if shown == _MATERIALIZED:
            detail = f"{record.stage} failed and Dagster shows an earlier result"
            yield Disagreement(DisagreementKind.FAILURE_NOT_LOGGED, detail, key, stage)
    elif shown != _MATERIALIZED:
        detail = f"{record.outcome} at {record.stage}, and Dagster shows it as {shown.lower()}"
        yield Disagreement(DisagreementKind.NOT_LOGGED, detail, key, stage)
    elif version != data_version(record):
        yield Disagreement(DisagreementKind.NOT_LOGGED, "Dagster shows an earlier result", key, stage)


def _materialization(key: str, stage: Stage, record: OutcomeRecord, storage: Storage) -> AssetMaterialization:
    action = Action.UNCHANGED if record.stage is stage else Action.NOT_REACHED
    return materialization(StageEvent(key, stage, action, record), storage)
