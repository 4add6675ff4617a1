"""What becomes stale when code changes: exactly the stages that run it.

A copy of the whole package is changed and asked for the code versions of its stages and of the warehouse.
"""

from __future__ import annotations

import ast
import inspect
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

import trace_dag
from trace_dag.code_versions import referred, signature_of
from trace_dag.flow.stages import FLOW
from trace_dag.settings import Settings
from trace_dag.stage import Stage

# Each change is asked about in a process of its own, forked before anything has been read.
ASK = """
import json, multiprocessing, pathlib, sys
from concurrent.futures import ProcessPoolExecutor
from trace_dag.code_versions import code_version
from trace_dag.flow.stages import FLOW
from trace_dag.settings import Settings, StateSettings
from trace_dag.stage import Stage

def versions(change):
    name, file, content = change
    path = pathlib.Path("trace_dag", file)
    before = path.read_text()
    path.write_text(content)
    found = {definition.stage: FLOW.code(definition, Settings()).digest for definition in FLOW.stages}
    asking = Settings(states=StateSettings(estimator="llm"))
    found["asked"] = FLOW.code(FLOW.definition(Stage.STATE_ESTIMATE), asking).digest
    found["warehouse"] = code_version(("trace_dag.warehouse.build",)).digest
    path.write_text(before)
    return name, found

found = {}
for change in json.load(sys.stdin):  # in a process for each: a version is read once in each
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as alone:
        name, of_change = alone.submit(versions, change).result()
    found[name] = of_change
print(json.dumps(found))
"""


ASKED = "asked"  # the estimates of a language model, which only those who choose it have


@dataclass(frozen=True)
class Change:
    """Another content of a file of the package, and whose results it makes stale."""

    file: str
    change: Callable[[str], str]
    stale: frozenset[str] | set[Stage] = frozenset()
    warehouse: bool | None = None  # None: whichever; the warehouse imports much


def with_statement(source: str) -> str:
    return source + "\n_CHANGED = 1\n"


def retold(source: str) -> str:
    """Other comments, docstrings and layout, the same code."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and ast.get_docstring(node):
            node.body[0] = ast.Expr(ast.Constant("Told otherwise."))
    return "# a comment\n" + ast.unparse(tree)


def otherwise(before: str, after: str) -> Callable[[str], str]:
    return lambda source: source.replace(before, after)


READ_A_MAP = {Stage.ROAD_MAP, Stage.STATE_ESTIMATE, Stage.SIMULATION_LOG, Stage.VERDICT}
CHANGES = {
    "nothing": Change("units.py", lambda source: source, warehouse=False),
    "a stage function": Change(
        "flow/stages/simulation_log.py", otherwise("do not touch", "never touch"), {Stage.SIMULATION_LOG}
    ),
    "a helper three imports away": Change("verdict/directions.py", with_statement, {Stage.VERDICT}),
    "a helper of a batch stage": Change("osm/cutting.py", with_statement, {Stage.OSM_EXTRACT}),
    "a helper of the maps": Change("roads/from_osm/polyline_fit.py", with_statement, {Stage.ROAD_MAP}),
    # a map is read back when it is made
    "the reader of an artefact": Change("roads/map/reader.py", with_statement, READ_A_MAP),
    "what all stages rest on": Change("errors.py", with_statement, set(Stage)),
    "words of a helper": Change("verdict/metrics.py", retold, warehouse=False),
    "words of a stage": Change("flow/stages/verdict.py", retold, warehouse=False),
    "words of what all rest on": Change("errors.py", retold, warehouse=False),
    "an import for type checkers": Change(
        "flow/stages/road_map.py",
        otherwise("if TYPE_CHECKING:\n", "if TYPE_CHECKING:\n    from trace_dag.scenario import site\n"),
    ),
    "an import inside a function": Change(
        "verdict/rules.py", lambda source: source + "\ndef _unused():\n    import trace_dag.osm.xml\n", {Stage.VERDICT}
    ),
    "a table read by the code": Change("states/prompts/segments-v1.md", lambda text: text + "Be brief.\n", {ASKED}),
    "a plugin that is not chosen": Change("estimators/llm.py", with_statement, {ASKED}),
    "a plugin that is": Change("states/solver.py", with_statement, {Stage.STATE_ESTIMATE}),
    "a view": Change("warehouse/sql/run_summary.sql", otherwise("BY began_at", "BY began_at DESC"), warehouse=True),
    "how work is done": Change("flow/worker.py", with_statement),
    "how services are asked": Change("cohorts/services.py", with_statement),
    "which stages there are": Change("flow/stages/__init__.py", with_statement),
    "how files are stored": Change("storage.py", with_statement),
}


@pytest.fixture(scope="module")
def versions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Code versions of a copy of the package, by change, of every stage and of the warehouse."""
    folder = tmp_path_factory.mktemp("copy")
    package = Path(trace_dag.__file__).parent
    shutil.copytree(package, folder / "trace_dag", ignore=shutil.ignore_patterns("__pycache__"))
    changed = []
    for name, each in CHANGES.items():
        content = (package / each.file).read_text()
        changed.append((name, each.file, each.change(content)))
        assert (changed[-1][2] == content) == (name == "nothing"), name
    environment = {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", ASK],
        cwd=folder,
        env=environment,
        input=json.dumps(changed),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, str]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_makes_stale_exactly_what_runs_it(versions, name):
    before, after, change = dict(versions["nothing"]), dict(versions[name]), CHANGES[name]
    if Stage.STATE_ESTIMATE in change.stale:
        assert before.pop(ASKED) != after.pop(ASKED), "language models are asked on top of the analytic estimator"
    rebuilt = before.pop("warehouse") != after.pop("warehouse")
    assert {stage for stage in before if before[stage] != after[stage]} == change.stale
    assert change.warehouse is None or rebuilt == change.warehouse


# --- what stages ask for ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("definition", FLOW.stages, ids=lambda definition: definition.stage)
def test_parameters_have_the_types_of_what_they_are_named_after(definition):
    """Parameters are given by name: one that is annotated as something else would be given the wrong thing."""
    for parameter in signature_of(definition.function).parameters:
        annotation = parameter.annotation
        if parameter.name == "settings":
            assert annotation in {info.annotation.__name__ for info in Settings.model_fields.values()}
        elif parameter.name in FLOW.artefacts:
            reader = FLOW.artefacts[parameter.name].reader
            returned = inspect.signature(referred(reader)).return_annotation if reader else "bytes"
            assert annotation == (f"Mapping[str, {returned}]" if definition.for_several else returned)
        else:
            assert parameter.name in {"key", "report", "maps", "map_service", "services"}


def test_inputs_are_made_by_earlier_stages():
    for definition in FLOW.stages:
        for artefact in FLOW.inputs(definition).values():
            assert artefact.stage.position < definition.stage.position
    assert not FLOW.inputs(FLOW.definition(Stage.RAW_REPORT))


def test_all_data_of_the_package_is_read_by_the_name_of_its_package():
    """Read otherwise (``__file__``, a package named by a variable) it would be in no fingerprint."""
    package = Path(trace_dag.__file__).parent
    read = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            called = ast.unparse(node.func).rpartition(".")[2] if isinstance(node, ast.Call) else ""
            if called == "files" and node.args and isinstance(node.args[0], ast.Constant):
                read.add(node.args[0].value)
    for path in package.rglob("*"):
        if path.is_file() and path.suffix not in (".py", ".pyc") and path.name != "py.typed":
            above = next(folder for folder in path.parents if (folder / "__init__.py").exists())
            assert ".".join(above.relative_to(package.parent).parts) in read, path
