"""Docstrings of the package: plain openings, as ``CONTRIBUTING.md`` asks for."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import lab
import trace_dag

PACKAGE = Path(trace_dag.__file__).parent
ROOMS = [*(path for path in sorted(PACKAGE.iterdir()) if path.is_dir()), Path(lab.__file__).parent]
BANNED = re.compile(r"(?:^|(?<=[.!?])\s+)(?:What|How|Where|Who|Whose|Whom|Whether|Why|Of|As)\b")
DOCUMENTED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Module)


def docstrings(path: Path) -> Iterator[tuple[str, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node)):
            yield getattr(node, "name", "the module"), text


@pytest.mark.parametrize("room", ROOMS, ids=lambda path: path.name)
def test_sentences_of_docstrings_begin_with_a_verb_or_a_noun(room: Path) -> None:
    wrong = [
        f"{path.relative_to(room.parent)}: {name}: {text[found.start() :][:60]}"
        for path in sorted(room.rglob("*.py"))
        for name, text in docstrings(path)
        if (found := BANNED.search(text))
    ]
    assert wrong == []
