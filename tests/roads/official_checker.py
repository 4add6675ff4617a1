"""Runs ASAM's official OpenDRIVE checker over files and prints what it found as one JSON object per file.

A script for the Python of the judges' environment (``asam-qc-opendrive`` cannot live beside this project's numpy),
given the files as arguments. ``rules`` are those that really ran to their end, ``skipped`` those it left out.
"""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path

from qc_baselib import Configuration, Result, StatusType
from qc_opendrive import constants
from qc_opendrive.main import run_checks


def check(path: str) -> dict[str, object]:
    config = Configuration()
    config.set_config_param("InputFile", path)
    config.register_checker_bundle(checker_bundle_name=constants.BUNDLE_NAME)
    result = Result()
    result.register_checker_bundle(
        name=constants.BUNDLE_NAME, description="", version=constants.BUNDLE_VERSION, summary=""
    )
    result.set_result_version(version=constants.BUNDLE_VERSION)
    run_checks(config, result)
    checkers = result._get_checker_bundle(constants.BUNDLE_NAME).checkers
    return {
        "file": path,
        "rules": sorted(c.checker_id for c in checkers if c.status == StatusType.COMPLETED),
        "skipped": sorted(c.checker_id for c in checkers if c.status == StatusType.SKIPPED),
        "broken": sorted(c.checker_id for c in checkers if c.status == StatusType.ERROR),
        "issues": [f"{c.checker_id} {issue.level.name}: {issue.description}" for c in checkers for issue in c.issues],
    }


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    for argument in sys.argv[1:]:
        sys.stdout.write(json.dumps(check(str(Path(argument).resolve()))) + "\n")
