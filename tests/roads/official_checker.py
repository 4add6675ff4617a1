"""Runs ASAM's official checkers over files and prints what they found as one JSON object per file.

A script for the Python of the judges' environment (``asam-qc-opendrive`` and ``asam-qc-openscenarioxml`` cannot live
beside this project's numpy), given the files as arguments, ``.xodr`` or ``.xosc``. ``rules`` are those that really ran
to their end, ``skipped`` those it left out.
"""

from __future__ import annotations

import importlib
import json
import logging
import sys
from pathlib import Path

from qc_baselib import Configuration, Result, StatusType

_BUNDLES = {".xodr": "qc_opendrive", ".xosc": "qc_openscenario"}


def check(path: Path) -> dict[str, object]:
    bundle = _BUNDLES[path.suffix]
    constants = importlib.import_module(f"{bundle}.constants")
    config = Configuration()
    config.set_config_param("InputFile", str(path))
    config.register_checker_bundle(checker_bundle_name=constants.BUNDLE_NAME)
    result = Result()
    result.register_checker_bundle(
        name=constants.BUNDLE_NAME, description="", version=constants.BUNDLE_VERSION, summary=""
    )
    result.set_result_version(version=constants.BUNDLE_VERSION)
    importlib.import_module(f"{bundle}.main").run_checks(config, result)
    checkers = result._get_checker_bundle(constants.BUNDLE_NAME).checkers
    return {
        "file": str(path),
        "rules": sorted(c.checker_id for c in checkers if c.status == StatusType.COMPLETED),
        "skipped": sorted(c.checker_id for c in checkers if c.status == StatusType.SKIPPED),
        "broken": sorted(c.checker_id for c in checkers if c.status == StatusType.ERROR),
        "issues": [f"{c.checker_id} {issue.level.name}: {issue.description}" for c in checkers for issue in c.issues],
    }


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    for argument in sys.argv[1:]:
        sys.stdout.write(json.dumps(check(Path(argument).resolve())) + "\n")
