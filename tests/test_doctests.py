"""The examples in docstrings are what the functions give.

An example may use what it does not make itself, by the names in :mod:`example_objects`; a name of the module's own is
the module's.
"""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest
from example_objects import NAMES, example_object

import trace_dag

PACKAGE = Path(trace_dag.__file__).parent


def modules_with_examples() -> list[str]:
    found = [path for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8")]
    return sorted(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in found)


@pytest.mark.parametrize("name", modules_with_examples())
def test_the_examples_of_a_module_hold(name):
    module = importlib.import_module(name)
    examples = re.findall(r"(?:>>>|\.\.\.) (.*)", Path(str(module.__file__)).read_text(encoding="utf-8"))
    used = set(re.findall(r"\w+", " ".join(examples))) & NAMES - vars(module).keys()
    result = doctest.testmod(module, extraglobs={each: example_object(each) for each in used})
    assert result.attempted > 0
    assert result.failed == 0
