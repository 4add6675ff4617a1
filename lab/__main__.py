"""One of the measures of this folder, by its name: ``python -m lab --root demo score_truth``."""

from __future__ import annotations

import os
import runpy
import sys
from pathlib import Path

_FOLDER = Path(__file__).parent
NAMES = sorted(
    ".".join(file.relative_to(_FOLDER).with_suffix("").parts)
    for file in _FOLDER.rglob("*.py")
    if not file.stem.startswith("_") and '__name__ == "__main__"' in file.read_text(encoding="utf-8")
)


def main() -> None:
    """Run the named measure with the arguments after its name; list all names if there is none such."""
    if sys.argv[1:2] == ["--root"] and len(sys.argv) > 2:
        os.environ["TRACE_DAG_ROOT"] = sys.argv[2]
        del sys.argv[1:3]
    if len(sys.argv) < 2 or sys.argv[1] not in NAMES:
        sys.exit(f"usage: python -m lab [--root DIR] NAME [ARGUMENTS]\nNAME is one of {', '.join(NAMES)}")
    sys.argv = [f"lab {sys.argv[1]}", *sys.argv[2:]]
    runpy.run_module(f"lab.{sys.argv[0].removeprefix('lab ')}", run_name="__main__")


if __name__ == "__main__":
    main()
