"""The examples in docstrings are what the functions give.

An example may use what it does not make itself, by the names of :func:`sample_names`.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from cases import SAMPLE, SETTINGS, sample_case

import trace_dag
from trace_dag.sim.backends import backend
from trace_dag.sim.run import simulate
from trace_dag.states.estimate import estimate
from trace_dag.verdict.judge import judge

PACKAGE = Path(trace_dag.__file__).parent
KEY = "2023-319003"
"""The sample's crash that the README shows: a car turns left across a motorcycle at Main Street and Elder Street."""


@cache
def sample_names() -> dict[str, object]:
    """What the program has of the sample's crash ``2023-319003``, from its report to its verdict."""
    case = sample_case(KEY)
    estimated = estimate(case.record, case.network, case.report, SETTINGS.states)
    logs = simulate(backend(SETTINGS.sim), case.network, case.xodr, estimated, SETTINGS.sim, record=case.record)
    return {
        "report_xml": (SAMPLE / "reports" / "crash_319003.xml").read_bytes(),
        "record": case.record,
        "xodr": case.xodr,
        "network": case.network,
        "map_report": case.report,
        "state_estimate": estimated,
        "log": logs[0],
        "verdict": judge(case.record, case.network, case.report, estimated, logs, SETTINGS.verdict),
    }


DOMAIN = ("crash", "osm", "roads", "states", "sim", "scenario", "verdict", "units.py", "geometry.py", "markdown.py")
PLAIN = {"int", "float", "str", "bool", "bytes", "None", "object", "tuple", "list", "dict", "set", "frozenset"}
PLAIN |= {"Sequence", "Iterable", "Mapping", "Collection"}
NAMES = "report_xml|record|xodr|network|map_report|state_estimate|log|verdict"


def modules_with_examples() -> list[str]:
    found = [path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8")]
    return sorted(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in found)


@pytest.mark.parametrize("name", modules_with_examples())
def test_the_examples_of_a_module_hold(name):
    module = importlib.import_module(name)
    examples = re.findall(r">>> (.*)", Path(str(module.__file__)).read_text(encoding="utf-8"))
    uses = any(re.search(rf"\b({NAMES})\b", each) for each in examples)
    result = doctest.testmod(module, extraglobs=sample_names() if uses else {})
    assert result.attempted > 0
    assert result.failed == 0


def public_functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Those of the domain, with the name of their module."""
    for part in DOMAIN:
        for path in sorted((PACKAGE / part).rglob("*.py")) or [PACKAGE / part]:
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    yield path.relative_to(PACKAGE).as_posix(), node


def takes_plain_values(function: ast.FunctionDef) -> bool:
    """Whether it has arguments, all of them numbers, text or collections of these."""
    given = function.args
    annotations = [each.annotation for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    names = [
        {node.id for node in ast.walk(each) if isinstance(node, ast.Name)} if each else set() for each in annotations
    ]
    return bool(names) and all(each and each <= PLAIN for each in names)


def test_functions_of_numbers_and_text_show_an_example():
    functions = [(where, each) for where, each in public_functions() if takes_plain_values(each)]
    without = [f"{where}: {each.name}" for where, each in functions if ">>> " not in (ast.get_docstring(each) or "")]
    assert len(functions) > 100
    assert without == []
