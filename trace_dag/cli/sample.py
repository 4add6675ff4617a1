"""The bundled sample: its folder and its cohort."""

from __future__ import annotations

from pathlib import Path

from trace_dag.common.errors import UserError

COHORT = "sample"


def sample_folder() -> Path:
    """Return the folder of the sample, in the installed package or in the repository beside it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "sample_data" / "sample", package.parent / "data" / "sample"):
        if (folder / "truth.json").is_file():
            return folder
    raise UserError("the bundled sample is not installed; expected it in trace_dag/sample_data/sample")
