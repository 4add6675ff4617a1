"""Asset specifications of the stages: group, owner, kinds, description, columns.

The stages themselves are in :mod:`reports`, :mod:`roads`, :mod:`scenarios` and :mod:`verdicts`; what materializing
them does is :mod:`trace_dag.assets.batch`.
"""

from collections.abc import Sequence
from typing import Any

from dagster import AssetSpec, TableColumn, TableSchema

from trace_dag.assets.partitions import CRASHES
from trace_dag.common import schemas
from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage

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
