"""With a version of Dagster that was not tried, everything runs on Dagster's public parts; and back again."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from trace_dag.assets import dagster_internals

REPOSITORY = Path(__file__).resolve().parents[2]
KEYS = [f"2023-{number}" for number in (510101, 510102)]

SCRIPT = """
import json, sys, warnings
from pathlib import Path
import dagster

folder, version = Path(sys.argv[1]), sys.argv[2]
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    if version:
        dagster.__version__ = version
    from trace_dag.assets.partitions import remove_partitions
    from tests.assets.conftest import Campaign

made = Campaign(folder, {key: "accept" for key in sys.argv[3:]})
report = made.run()
removed = remove_partitions(made.instance, [sys.argv[3]])
print(json.dumps({
    "warned": [str(each.message) for each in caught if "tried with Dagster" in str(each.message)],
    "event_log": type(made.instance.event_log_storage).__name__,
    "loaded": "trace_dag.assets.event_log" in sys.modules,
    "errors": report.errors,
    "removed": removed,
    "statuses": sorted(set(made.statuses().values())),
    "keys": list(made.instance.get_dynamic_partitions("crashes")),
}))
made.instance.dispose()
"""


def run_with(version: str, folder: Path) -> dict[str, object]:
    """What a process finds that runs fake crashes of a root with a Dagster of that version, or the installed one."""
    paths = os.pathsep.join(map(str, (REPOSITORY, REPOSITORY / "tests")))
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(folder), version, *KEYS],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": paths},
    )
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


def test_another_version_of_dagster_works_with_a_warning_and_the_way_back_is_open(tmp_path):
    settings = tmp_path / "root" / "dagster" / "dagster.yaml"
    common = {"errors": [], "removed": 1, "statuses": ["MATERIALIZED"], "keys": KEYS[1:]}
    ours = run_with("", tmp_path)
    assert ours == {"warned": [], "event_log": "EventLog", "loaded": True, **common}
    as_written = settings.read_text()

    other = run_with("1.14.2", tmp_path)
    assert other.pop("warned") == [
        "trace-dag was tried with Dagster 1.13.20 up to 1.14.0, and 1.14.2 is installed: it works with Dagster's own "
        "event log, which takes longer"
    ]
    assert other == {"event_log": "SqliteEventLogStorage", "loaded": False, **common}

    assert run_with("", tmp_path) == ours
    assert settings.read_text() == as_written


@pytest.mark.parametrize(
    ("version", "tried"),
    [("1.13.20", True), ("1.13.99", True), ("1.14.0", False), ("1.13.19", False), ("2.0.0", False), ("dev", False)],
)
def test_which_versions_were_tried(version, tried):
    assert dagster_internals.is_tried(version) is tried


def test_what_was_tried_is_what_the_project_asks_for():
    import tomllib

    asked = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["dependencies"]
    first, end = (".".join(map(str, numbers)) for numbers in dagster_internals.TRIED)
    assert f"dagster>={first},<{end.removesuffix('.0')}" in asked
