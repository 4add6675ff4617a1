"""Assets of the stages in the UI: their specifications, and the metadata of each crash in them, outcome first.

Their materialization is :mod:`trace_dag.assets.batch`.
"""

from __future__ import annotations

import base64
import shlex
from collections.abc import Mapping
from typing import Any

from dagster import AssetMaterialization, AssetSpec, MetadataValue, TableColumn, TableSchema

from trace_dag.assets.run_requests import CRASHES
from trace_dag.common import schemas
from trace_dag.common.errors import DamagedFile, Reason
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.export.crash_files import page_name
from trace_dag.flow.contract import StageDefinition
from trace_dag.flow.stages import FLOW
from trace_dag.flow.tasks import Action, StageEvent
from trace_dag.pages.canvas import reduce_picture
from trace_dag.simulation.log_io import SIMULATION_STEPS

DATA_VERSION = "dagster/data_version"
_SMALL_PX = 320
HOW_TO_FORCE = (
    "To compute again all the same, give the run the configuration `ops: {crashes: {config: {force: [all]}}}` (or "
    "names of stages in place of `all`); in a terminal, `trace-dag run --only KEY --from STAGE`."
)
_SITE = "/site"  # where trace-dag ui serves the root: a browser completes the link with the server's own name


def data_version(record: OutcomeRecord) -> str:
    """Return the version of a result for Dagster: the first characters of its record's fingerprint."""
    return record.fingerprint[:16]


def materialization(event: StageEvent, storage: Storage, site_url: str | None = None) -> AssetMaterialization:
    """Return the materialization of a stage and crash."""
    if event.record is None:
        raise ValueError(f"{event.key} {event.stage}: no metadata, because the stage did not run")
    return AssetMaterialization(
        event.stage.value,
        partition=event.key,
        metadata=event_metadata(event, storage, site_url),
        tags={DATA_VERSION: data_version(event.record)},
    )


def event_metadata(event: StageEvent, storage: Storage, site_url: str | None = None) -> Mapping[str, Any]:
    """Return the metadata of a materialization.

    ``outcome``, ``reason`` and ``stage_reached`` are always present.

    ``site_url`` is the address of the root's pages and pictures, if another server serves them.
    """
    record = event.record
    if record is None:
        raise ValueError(f"{event.key} {event.stage}: no picture, because the stage did not run")
    metadata: dict[str, Any] = {
        "outcome": record.outcome.value,
        "stage_reached": record.stage.value,
        "reason": record.reason.value if record.reason else "",
    }
    if record.outcome is Outcome.REJECTED:
        metadata["detail"] = record.detail
        metadata["published_category"] = record.reason.published_category.value if record.reason else ""
        if record.measured is not None:
            metadata["measured"] = round(record.measured, 6)
        if record.threshold is not None:
            metadata["threshold"] = record.threshold
    if event.no_picture:
        metadata["picture"] = f"could not be drawn: {event.no_picture}"
    if event.stage is Stage.VERDICT:
        metadata.update(picture_metadata(record, storage, site_url))
        # Of every crash, rejected or not; made or brought up to date when the runs are done.
        metadata[_linked("page", site_url)] = MetadataValue.url(f"{site_url or _SITE}/{page_name(event.key)}")
        metadata["page file"] = MetadataValue.path(storage.path(page_name(event.key)))
    if event.action is Action.NOT_REACHED:
        return metadata
    if event.stage is Stage.STATE_ESTIMATE:
        metadata |= {"model": "none", "cost_usd": 0.0, "fallback": fallback_in_words(record)}
    metadata.update({name: value for name, value in record.figures.items() if value is not None})
    for file in record.artefacts:
        metadata[f"artefact .{file.name.partition('.')[2]}"] = MetadataValue.path(storage.path(file.name))
    if event.stage in (Stage.SIMULATION_LOG, Stage.VERDICT):
        metadata["replay"] = f"trace-dag --root {shlex.quote(storage.root)} replay {event.key}"
    metadata["computed"] = event.action is Action.COMPUTED
    if event.action is Action.UNCHANGED:
        metadata["nothing to do"] = MetadataValue.md(f"It was up to date, so nothing was computed. {HOW_TO_FORCE}")
    metadata["duration_s"] = record.duration_s
    return metadata


def fallback_in_words(record: OutcomeRecord) -> str:
    """Return a text with the fallback estimator, the one it replaced and the reason; "none" without a fallback."""
    asked, why = record.figures.get("fallback_from"), record.figures.get("fallback_reason")
    return f"{record.figures.get('estimator')} in place of {asked}: {why}" if asked else "none"


def picture_metadata(record: OutcomeRecord, storage: Storage, site_url: str | None = None) -> dict[str, Any]:
    """Return the crash's picture: a small one in place, a link to the whole one, and the path of the file.

    Empty if the picture is missing or damaged. The whole picture is only linked, since the event log would store it two
    more times.
    """
    picture = record.picture("png")
    if picture is None:
        return {}
    try:
        small = base64.b64encode(reduce_picture(storage.read_whole(picture), _SMALL_PX)).decode()
    except DamagedFile as damaged:
        return {"picture": str(damaged)}
    return {
        "sketch": MetadataValue.md(f"![{record.key} from above](data:image/png;base64,{small})"),
        _linked("picture", site_url): MetadataValue.url(f"{site_url or _SITE}/{picture.name}"),
        "picture file": MetadataValue.path(storage.path(picture.name)),
    }


def _linked(what: str, site_url: str | None) -> str:
    """Return the name of a link, with a note if this server does not serve the site."""
    return what if site_url else f"{what}, served by trace-dag ui"


OWNERS = ["team:crash-reconstruction"]


_ABOUT: Mapping[Stage, tuple[str, set[str], str]] = {
    Stage.RAW_REPORT: (
        "reports",
        {"xml", "json"},
        "The crash report as its source serves it: NHTSA's CrashAPI XML, untouched, or a table's rows.",
    ),
    Stage.CRASH_RECORD: (
        "reports",
        {"parquet", "python"},
        "The report as typed data: the crash, its vehicles and its events in SI units, unknown as null, classified "
        "along the three dimensions of coverage. Rejected if it does not say enough.",
    ),
    Stage.OSM_EXTRACT: (
        "roads",
        {"openstreetmap", "file"},
        "The drivable roads of OpenStreetMap around the reported point. © OpenStreetMap contributors, ODbL 1.0.",
    ),
    Stage.ROAD_MAP: (
        "roads",
        {"opendrive", "python"},
        "The road map as OpenDRIVE 1.7, with the crash's place on it, the gates it passed and how it agrees with the "
        "report.",
    ),
    Stage.STATE_ESTIMATE: (
        "scenarios",
        {"json", "python"},
        "Impact and initial states of the vehicles, for one hypothesis or several, best first. Reported speeds are "
        "kept.",
    ),
    Stage.SIMULATION_LOG: (
        "scenarios",
        {"parquet", "mujoco"},
        "What happens when the estimate is simulated: states per step, contacts, and why it ended.",
    ),
    Stage.VERDICT: (
        "verdicts",
        {"json", "python"},
        "Whether the simulated crash is the reported one: every criterion with its value, threshold and whether it "
        "holds, and the crash's picture.",
    ),
}
"""Group, kinds and description of each stage's asset."""
_COLUMNS = {Stage.CRASH_RECORD: CRASH_RECORD, Stage.SIMULATION_LOG: SIMULATION_STEPS}


def _spec(definition: StageDefinition) -> AssetSpec:
    """Return the specification of a stage's asset; its description ends with its reasons for rejection."""
    stage = definition.stage
    group, kinds, description = _ABOUT[stage]
    before = {each.stage for each in FLOW.inputs(definition).values()}
    reasons = [reason.value for reason in Reason if reason.stage is stage]
    metadata: dict[str, Any] = {"artefact": f"ROOT/{stage}/<key>.*"}
    if stage in _COLUMNS:
        metadata["dagster/column_schema"] = column_schema(_COLUMNS[stage])
    return AssetSpec(
        stage.value,
        deps=[each.value for each in Stage if each in before],
        group_name=group,
        kinds=kinds,
        owners=OWNERS,
        description=description + (f"\n\nMay reject a crash as: {', '.join(reasons)}." if reasons else ""),
        metadata=metadata,
        partitions_def=CRASHES,
        skippable=True,
    )


def as_markdown(text: str) -> str:
    """Return text escaped for the UI, which would drop ``<...>`` as HTML."""
    return text.replace("<", "\\<")


def column_schema(table: schemas.TableSchema) -> TableSchema:
    """Return a declared table as Dagster's column schema: nested columns by dotted path, units in the descriptions."""
    return TableSchema(
        columns=[
            TableColumn(
                row["column"],
                type=row["type"].lower(),
                description=as_markdown(
                    row["meaning"]
                    + (f" ({row['unit']})" if row["unit"] else "")
                    + (f"; FARS {row['source']}" if row["source"] else "")
                ),
            )
            for row in table.dictionary()
        ]
    )


STAGES = tuple(map(_spec, FLOW.stages))
"""The assets of the stages, in their order."""
