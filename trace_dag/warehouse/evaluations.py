"""Evaluations, variations and traffic as the Arrow tables that the warehouse's SQL reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.agents import evaluations, stored_traffic, stored_variations
from trace_dag.agents.evaluation.table import EVALUATIONS
from trace_dag.agents.stored_traffic import TRAFFIC
from trace_dag.agents.variations.table import VARIATIONS
from trace_dag.common.storage.files import Storage
from trace_dag.flow.records import OnProblem

if TYPE_CHECKING:
    import pyarrow as pa


def evaluation_tables(storage: Storage, on_problem: OnProblem) -> dict[str, pa.Table]:
    """Return the stored rows of each by the names in SQL, those of changed crashes included.

    ``on_problem`` is called with the files left out because they are damaged.
    """
    import pyarrow as pa

    return {
        "evaluation": pa.Table.from_pylist(
            evaluations.all_rows(storage, on_problem=on_problem), schema=EVALUATIONS.arrow()
        ),
        "variation": pa.Table.from_pylist(
            stored_variations.all_rows(storage, on_problem=on_problem), schema=VARIATIONS.arrow()
        ),
        "traffic_row": pa.Table.from_pylist(
            stored_traffic.all_rows(storage, on_problem=on_problem), schema=TRAFFIC.arrow()
        ),
    }
