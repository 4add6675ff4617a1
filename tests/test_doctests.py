"""The examples in docstrings are what the functions give.

An example may use what it does not make itself, by the names in :mod:`example_objects`.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from example_objects import NAMES, example_object

import trace_dag

PACKAGE = Path(trace_dag.__file__).parent
DOMAIN = ("crash", "osm", "roads", "states", "sim", "scenario", "verdict", "units.py", "geometry.py", "markdown.py")
WITHOUT = {
    "osm/first_reading.py: serve": "the loop of a process of its own, on its standard input",
    "roads/from_osm/osm2odr.py: convert_with_osm2odr": "needs the extra carla",
    "roads/from_osm/osm2odr.py: run_osm2odr": "needs the extra carla",
}
"""Public functions that no example can show here, and why."""


def modules_with_examples() -> list[str]:
    found = [path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8")]
    return sorted(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in found)


@pytest.mark.parametrize("name", modules_with_examples())
def test_the_examples_of_a_module_hold(name):
    module = importlib.import_module(name)
    examples = re.findall(r"(?:>>>|\.\.\.) (.*)", Path(str(module.__file__)).read_text(encoding="utf-8"))
    used = set(re.findall(r"\w+", " ".join(examples))) & NAMES
    result = doctest.testmod(module, extraglobs={each: example_object(each) for each in used})
    assert result.attempted > 0
    assert result.failed == 0


def public_functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Those of the domain, with the name of their module."""
    for part in DOMAIN:
        for path in sorted((PACKAGE / part).rglob("*.py")) or [PACKAGE / part]:
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    yield path.relative_to(PACKAGE).as_posix(), node


def test_every_public_function_of_the_domain_shows_an_example():
    shown = {f"{where}: {each.name}": ">>> " in (ast.get_docstring(each) or "") for where, each in public_functions()}
    assert len(shown) > 700
    assert sorted(name for name, shows in shown.items() if not shows) == sorted(WITHOUT)
