"""Arrows point one way: a module knows nothing of what stands above it, and only the top knows Dagster."""

from __future__ import annotations

import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from touched import imported

import trace_dag

PACKAGE = Path(trace_dag.__file__).parent

LAYERS = (
    {"version"},
    {"common"},
    # the domain, in the order of the flow
    {"crash"},
    {"osm"},
    {"roads"},
    {"simulation"},
    {"reconstruction"},
    {"verdict"},
    {"scenario"},
    {"pages"},
    # what runs it
    {"flow"},
    {"agents"},
    {"warehouse"},
    {"export"},
    {"reading"},
    # wings, which entry points name
    {"gym", "language", "carla"},
    # Dagster and the command line
    {"assets"},
    {"cli"},
)
"""Every package and module at the top, from the lowest up; those of one layer do not know each other."""

ROADS = ("map", "report", "from_osm", "crash_site", "gates", "build")
MAY_KNOW_DAGSTER = {"assets", "cli"}


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def top(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def test_every_package_has_its_layer():
    assert {top(name) for name in MODULES} - {""} == set().union(*LAYERS)
    assert {name.split(".")[2] for name in MODULES if name.startswith("trace_dag.roads.")} == set(ROADS)


@pytest.mark.parametrize("layer", range(len(LAYERS)), ids=lambda number: "+".join(sorted(LAYERS[number])))
def test_no_arrow_points_up(layer):
    above = set().union(*LAYERS[layer + 1 :])
    for own in LAYERS[layer]:
        beside = LAYERS[layer] - {own}
        for name, path in MODULES.items():
            if top(name) == own:
                wrong = {
                    each for each in imported(path) if each.startswith("trace_dag.") and top(each) in above | beside
                }
                assert not wrong, f"{name} imports {wrong}"


@pytest.mark.parametrize("part", ROADS)
def test_no_arrow_points_up_in_roads(part):
    above = tuple(f"trace_dag.roads.{each}" for each in ROADS[ROADS.index(part) + 1 :])
    for name, path in MODULES.items():
        if name.startswith(f"trace_dag.roads.{part}"):
            wrong = {each for each in imported(path) if each.startswith(above)}
            assert not wrong, f"{name} imports {wrong}"


def test_no_modules_import_each_other_in_a_circle():
    graph = {name: imported(path) & MODULES.keys() for name, path in MODULES.items()}
    circle = []
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = error.args[1]
    assert circle == []


def test_only_assets_and_the_command_line_import_dagster():
    guilty = {
        name
        for name, path in MODULES.items()
        if any(each.split(".")[0].startswith("dagster") for each in imported(path))
        and top(name) not in MAY_KNOW_DAGSTER
    }
    assert guilty == set()


def test_nothing_is_imported_from_private_parts_of_dagster():
    private = {
        name
        for name, path in MODULES.items()
        if any(each.startswith("dagster") and "._" in each for each in imported(path))
    }
    assert private == set()


def test_the_whole_flow_runs_without_dagster_being_loaded():
    code = (
        "import sys, trace_dag.flow.batch, trace_dag.flow.stages, trace_dag.export.build\n"
        "from trace_dag.common.settings import Settings\n"
        "trace_dag.flow.stages.FLOW.recipes(Settings())\n"
        "sys.exit(any(name.split('.')[0] == 'dagster' for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
