"""The numbers of the code of stages and of what is made of many crashes, and what stages ask for."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

import trace_dag
from tests.code_digests import digests, numbers, recorded
from trace_dag.common.references import referred, signature_of
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.flow.stages import FLOW

NOW, NUMBERS, RECORDED = digests(), numbers(), recorded()


@pytest.mark.parametrize("name", NUMBERS)
def test_whoever_changes_code_says_whether_other_results_come_out(name: str) -> None:
    assert {"number": NUMBERS[name], "digest": NOW[name]} == RECORDED[name], (
        f"the code of {name} has changed since its number was set. If other results come out of the same input, raise "
        "the number (VERSIONS in trace_dag/flow/stages/__init__.py, or VERSION where the warehouse, the benchmark, "
        "evaluations or variations are made). Then, in either case: python -m tests.code_digests"
    )


def test_the_code_of_a_stage_is_what_it_runs() -> None:
    """A change of the verdict's rules is one of the verdict alone; all maps are read by the same reader."""
    from tests import code_digests

    def users(module: str) -> set[str]:
        found = set()
        for definition in FLOW.stages:
            readers = {each.reader for each in FLOW.inputs(definition).values() if each.reader}
            modules = {name.partition(":")[0] for name in (definition.function, *readers)}
            if module in code_digests._closure(modules):
                found.add(definition.stage)
        return found

    assert users("trace_dag.verdict.rules") == {Stage.VERDICT}
    assert users("trace_dag.osm.clip") == {Stage.OSM_EXTRACT}
    assert users("trace_dag.common.errors") == set(Stage)
    assert users("trace_dag.roads.map.reader") == set(Stage) - {
        Stage.RAW_REPORT,
        Stage.CRASH_RECORD,
        Stage.OSM_EXTRACT,
    }
    assert users("trace_dag.flow.worker") == set()


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
            expected = f"Mapping[str, {returned}]" if definition.for_several else returned
            assert annotation.removesuffix(" | None") == expected
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
