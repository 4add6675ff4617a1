"""Arrows point one way: domain packages know nothing of Dagster, nor of what comes later in the flow."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import trace_dag

PACKAGE = Path(trace_dag.__file__).parent
MAY_KNOW_DAGSTER = {"assets", "resources", "definitions"}
FLOW = ["crash", "osm", "roads", "states", "sim", "evaluation", "variations", "verdict", "scenario"]


def modules(*parts: str) -> list[Path]:
    return sorted(PACKAGE.joinpath(*parts).rglob("*.py"))


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


def test_only_assets_and_resources_import_dagster():
    guilty = {
        str(path.relative_to(PACKAGE))
        for path in modules()
        if any(name.split(".")[0].startswith("dagster") for name in imports(path))
        and path.relative_to(PACKAGE).parts[0].removesuffix(".py") not in MAY_KNOW_DAGSTER
    }
    assert guilty == set()


@pytest.mark.parametrize("package", FLOW)
def test_packages_do_not_import_what_comes_later_or_above(package):
    later = [*FLOW[FLOW.index(package) + 1 :], "pipeline", "assets", "resources", "warehouse", "cli"]
    for path in modules(package):
        for name in imports(path):
            parts = name.split(".")
            assert not (parts[0] == "trace_dag" and len(parts) > 1 and parts[1] in later), f"{path.name}: {name}"


def test_the_whole_flow_runs_without_dagster_being_loaded():
    code = (
        "import sys, trace_dag.pipeline.batch, trace_dag.pipeline.stages, trace_dag.warehouse.build\n"
        "from trace_dag.pipeline.tasks import Work\n"
        "Work.code_versions(trace_dag.pipeline.stages.FLOW)\n"
        "sys.exit(any(name.split('.')[0] == 'dagster' for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
