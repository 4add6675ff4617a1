"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
import read_revisions_once  # noqa: F401 - for what it does

from trace_dag.flow.executors import available_cores

REPOSITORY = Path(__file__).resolve().parents[1]

# How fast the machine is, or what else it does, fails no test, and neither does an example that another machine has
# not seen: pytest --hypothesis-profile="new examples" looks for those.
for _profile, _the_same in (("same examples", True), ("new examples", False)):
    hypothesis.settings.register_profile(
        _profile,
        deadline=None,
        derandomize=_the_same,
        suppress_health_check=[hypothesis.HealthCheck.too_slow, hypothesis.HealthCheck.data_too_large],
    )
hypothesis.settings.load_profile("same examples")

# One thread for each process: the tests run on all cores already. Read when numpy is first imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


# What is imported stays: going through it again and again for garbage took 7 % of the tests' time.
gc.disable()


def pytest_configure(config: pytest.Config) -> None:
    """A folder that all workers of this run share; they inherit its name."""
    if not hasattr(config, "workerinput"):
        os.environ["TRACE_DAG_TESTS_SHARED"] = tempfile.mkdtemp(prefix="trace-dag-tests-")


def pytest_xdist_auto_num_workers() -> int | None:
    """Three more than there are cores, which tests that wait for other processes would leave idle for a while."""
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else available_cores() + 3


def pytest_unconfigure(config: pytest.Config) -> None:
    gc.unfreeze()  # else DuckDB, when it ends, tells of all that is still there
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop("TRACE_DAG_TESTS_SHARED", ""), ignore_errors=True)


# What takes long by nature: pages typed through, processes started and killed, browsers, clusters, real cohorts,
# fuzzing, judges.
SLOW = (
    "agents/test_evaluations_on_cluster.py",
    "agents/test_hostile_agents.py",
    "assets/test_backfills.py",
    "assets/test_daemon.py",
    "assets/test_web_server.py",
    "cli/test_carla_kit.py",
    "cli/test_driving.py",
    "cli/test_interruption.py",
    "docs",
    "faults",
    "flow/test_llm_runs.py",
    "fuzz",
    "gym",
    "notebooks",
    "roads/test_judges.py",
    "sample",
    "scenario/test_accessibility.py",
    "scenario/test_players.py",
    "scenario/test_replay_frames.py",
    "scenario/test_replay_in_browser.py",
    "simulation/test_real_crashes.py",
    "reconstruction/test_known_directions.py",
    "test_masked_reports.py",
    "test_packaging.py",
    "test_plugins_installed.py",
    "warehouse/test_real_cohorts.py",
)
"""Folders and files below tests/ whose tests are marked slow."""
_DURATIONS = REPOSITORY / "build" / "durations.json"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of slow folders and files."""
    assert all((REPOSITORY / "tests" / each).exists() for each in SLOW), "SLOW names what is not there"
    for item in items:
        where = item.path.relative_to(REPOSITORY / "tests").as_posix()
        if where.startswith(tuple(f"{each}/" for each in SLOW)) or where in SLOW:
            item.add_marker(pytest.mark.slow)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Write how long each test of this run took, in seconds, the slowest first."""
    seconds: dict[str, float] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                seconds[report.nodeid] = round(seconds.get(report.nodeid, 0.0) + report.duration, 3)
    _DURATIONS.parent.mkdir(exist_ok=True)
    _DURATIONS.write_text(json.dumps(dict(sorted(seconds.items(), key=lambda each: -each[1])), indent=1))


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def environment_as_it_was() -> Iterator[None]:
    """A command tells the processes that it starts its root in the environment; the next test has another one, and so
    has whoever runs the tests."""
    before = {name: value for name, value in os.environ.items() if name not in ("TRACE_DAG_ROOT", "DAGSTER_HOME")}
    os.environ.pop("TRACE_DAG_ROOT", None)
    os.environ.pop("DAGSTER_HOME", None)
    yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real reports and map extracts outside the project; tests that need them skip where they are absent."""
    folder = Path(os.environ.get("TRACE_DAG_SHARED", REPOSITORY.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"real data not present at {folder} (set TRACE_DAG_SHARED to the folder that holds data/)")
    return folder
