"""Plugins of another package as an installer leaves them: listed, run, and part of what makes a result current."""

from __future__ import annotations

import json
import os
from pathlib import Path

from sample_runs import SAMPLE, reports_of, study, trace_dag_process

from trace_dag.common.provenance import record_from_json

KEY = "2023-319003"
MODULE = '''
from dataclasses import replace

from trace_dag.reconstruction.search import estimate_by_record
from trace_dag.simulation.embedded import EmbeddedBackend


class Slower:
    """The analytic estimator, which says that it is another."""

    paid = False

    def __init__(self, settings, files=None, ledger="run"):
        self.settings = settings

    def require(self):
        pass

    def estimate(self, record, network, report):
        made = estimate_by_record(record, network, report, self.settings)
        return replace(made, run=replace(made.run, estimator="elsewhere", version="7"))

    @staticmethod
    def variant(settings, name):
        return settings.model_copy(update={"max_hypotheses": int(name.removeprefix(":"))})


class Heavier(EmbeddedBackend):
    """The embedded back-end under a name of its own."""

    name = "elsewhere"
    one_at_a_time = False


class Broken:
    """Cannot be used on this machine."""

    @staticmethod
    def require(settings):
        from trace_dag.common.errors import UserError

        raise UserError("the simulator elsewhere needs a licence")
'''
ENTRY_POINTS = """
[trace_dag.backends]
elsewhere = simulator_elsewhere:Heavier
unlicensed = simulator_elsewhere:Broken
gone = simulator_elsewhere:Nothing

[trace_dag.estimators]
elsewhere = simulator_elsewhere:Slower
"""


def install(folder: Path, version: str) -> dict[str, str]:
    """A package as an installer leaves it, and the environment in which Python finds it."""
    folder.mkdir(exist_ok=True)
    (folder / "simulator_elsewhere.py").write_text(MODULE)
    for old in folder.glob("*.dist-info"):
        for file in old.iterdir():
            file.unlink()
        old.rmdir()
    about = folder / f"simulator_elsewhere-{version}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: simulator-elsewhere\nVersion: {version}\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    return {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


def test_a_back_end_of_another_package_is_listed_run_and_part_of_the_fingerprint(tmp_path: Path) -> None:
    root, elsewhere = tmp_path / "root", {"TRACE_DAG_SIM__BACKEND": "elsewhere", "TRACE_DAG_EXECUTION__WORKERS": "1"}
    environment = install(tmp_path / "site", "1.2") | elsewhere
    listed = json.loads(trace_dag_process(root, "plugins", "--json", **environment).stdout)
    assert {
        "kind": "backends",
        "name": "elsewhere",
        "package": "simulator-elsewhere",
        "version": "1.2",
        "reference": "simulator_elsewhere:Heavier",
    } in listed
    reports = reports_of(tmp_path / "reports", [KEY])
    assert trace_dag_process(root, "ingest", "--reports", str(reports), "--maps", str(SAMPLE / "osm")).returncode == 0
    assert trace_dag_process(root, "run", **environment).returncode == 0

    def record():
        name = f"simulation_log/{KEY}.outcome.json"
        return record_from_json((root / name).read_bytes(), name=name)

    assert record().provenance.libraries["simulator-elsewhere"] == "1.2"
    environment = install(tmp_path / "site", "1.3") | elsewhere
    assert trace_dag_process(root, "run", **environment).returncode == 0
    assert record().provenance.libraries["simulator-elsewhere"] == "1.3"
    unlicensed = trace_dag_process(root, "run", **{**environment, "TRACE_DAG_SIM__BACKEND": "unlicensed"})
    assert (unlicensed.returncode, unlicensed.stderr.strip()) == (
        2,
        "trace-dag: the simulator elsewhere needs a licence",
    )
    gone = trace_dag_process(root, "run", **{**environment, "TRACE_DAG_SIM__BACKEND": "gone"})
    assert gone.returncode == 2
    assert "backends gone (simulator-elsewhere 1.3) cannot be loaded" in gone.stderr


def test_an_estimator_of_another_package_is_run_compared_and_part_of_the_fingerprint(tmp_path: Path) -> None:
    root = tmp_path / "root"
    environment = install(tmp_path / "site", "1.2") | {"TRACE_DAG_EXECUTION__EXECUTOR": "in_process"}
    reports = reports_of(tmp_path / "reports", [KEY])
    assert trace_dag_process(root, "ingest", "--reports", str(reports), "--maps", str(SAMPLE / "osm")).returncode == 0
    done = trace_dag_process(root, "run", "--estimator", "elsewhere", **environment)
    assert (done.returncode, "1 estimate: 1 by elsewhere" in done.stdout) == (0, True), done.stderr
    name = f"state_estimate/{KEY}.outcome.json"
    record = record_from_json((root / name).read_bytes(), name=name)
    assert record.provenance.libraries["simulator-elsewhere"] == "1.2"
    assert record.provenance.settings["estimator"] == "elsewhere"
    compared = study(root, "compare_estimators", "--estimators", "analytic,elsewhere:1", "--json", **environment)
    rows = json.loads(compared.stdout)
    assert [(row["estimator"], row["outcome"], row["accepted"]) for row in rows] == [
        ("analytic", "estimated", True),
        ("elsewhere:1", "estimated", True),
    ]
