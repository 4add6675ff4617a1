"""Asset specifications of the stages: group, owner, kinds, description, columns.

Their materialization is :mod:`trace_dag.assets.batch`.
"""

from collections.abc import Sequence
from typing import Any

from dagster import AssetSpec, TableColumn, TableSchema

from trace_dag.assets.run_requests import CRASHES
from trace_dag.common import schemas
from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage
from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.simulation.log_io import SIMULATION_STEPS

OWNERS = ["team:crash-reconstruction"]


def stage_spec(
    stage: Stage,
    *,
    group: str,
    kinds: set[str],
    description: str,
    deps: Sequence[Stage] = (),
    columns: schemas.TableSchema | None = None,
) -> AssetSpec:
    """Return the specification of a stage's asset; its description ends with its reasons for rejection."""
    reasons = [reason.value for reason in Reason if reason.stage is stage]
    metadata: dict[str, Any] = {"artefact": f"ROOT/{stage}/<key>.*"}
    if columns is not None:
        metadata["dagster/column_schema"] = column_schema(columns)
    return AssetSpec(
        stage.value,
        deps=[each.value for each in deps],
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


STAGES = (
    stage_spec(
        Stage.RAW_REPORT,
        group="reports",
        kinds={"xml", "json"},
        description="The crash report as its source serves it: NHTSA's CrashAPI XML, untouched, or a table's rows.",
    ),
    stage_spec(
        Stage.CRASH_RECORD,
        group="reports",
        kinds={"parquet", "python"},
        deps=[Stage.RAW_REPORT],
        columns=CRASH_RECORD,
        description="The report as typed data: the crash, its vehicles and its events in SI units, unknown as null, "
        "classified along the three dimensions of coverage. Rejected if it does not say enough.",
    ),
    stage_spec(
        Stage.OSM_EXTRACT,
        group="roads",
        kinds={"openstreetmap", "file"},
        deps=[Stage.CRASH_RECORD],
        description="The drivable roads of OpenStreetMap around the reported point. "
        "© OpenStreetMap contributors, ODbL 1.0.",
    ),
    stage_spec(
        Stage.ROAD_MAP,
        group="roads",
        kinds={"opendrive", "python"},
        deps=[Stage.CRASH_RECORD, Stage.OSM_EXTRACT],
        description="The road map as OpenDRIVE 1.7, with the crash's place on it, the gates it passed and how it "
        "agrees with the report.",
    ),
    stage_spec(
        Stage.STATE_ESTIMATE,
        group="scenarios",
        kinds={"json", "python"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP],
        description="Impact and initial states of the vehicles, for one hypothesis or several, best first. "
        "Reported speeds are kept.",
    ),
    stage_spec(
        Stage.SIMULATION_LOG,
        group="scenarios",
        kinds={"parquet", "mujoco"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP, Stage.STATE_ESTIMATE],
        columns=SIMULATION_STEPS,
        description="What happens when the estimate is simulated: states per step, contacts, and why it ended.",
    ),
    stage_spec(
        Stage.VERDICT,
        group="verdicts",
        kinds={"json", "python"},
        deps=[Stage.CRASH_RECORD, Stage.ROAD_MAP, Stage.STATE_ESTIMATE, Stage.SIMULATION_LOG],
        description="Whether the simulated crash is the reported one: every criterion with its value, threshold and "
        "whether it holds, and the crash's picture.",
    ),
)
"""The assets of the stages, in their order."""
