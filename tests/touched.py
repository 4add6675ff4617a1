"""The tests that a change touches, for ``./check --fast``: those changed, and those nearest to the changed modules.

Prints arguments for pytest. A change is what differs from the branch ``main`` (or from the last commit, on it),
uncommitted files included. Nearest to a module are the tests that import it; where none does, those that import what
imports it, and so on. With them go the examples in docstrings of the changed modules.
"""

from __future__ import annotations

import ast
import subprocess
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
SLOW = ("tests/docs/", "tests/notebooks/", "tests/cli/", "tests/faults/", "tests/sample/")
"""Tests across everything, which take minutes: for ``./check``, unless they were changed or are nearest."""


def git(*arguments: str) -> list[str]:
    done = subprocess.run(["git", *arguments], cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout.split()


def changed() -> set[str]:
    base = "HEAD" if git("rev-parse", "HEAD") == git("rev-parse", "main") else git("merge-base", "HEAD", "main")[0]
    return {*git("diff", "--name-only", base), *git("ls-files", "--others", "--exclude-standard")}


def imported(path: Path) -> set[str]:
    """Every module that a file names in an import, within functions and for type checking too, and what it takes."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def named(path: Path) -> set[str]:
    """The modules that a file names in text, as stages and entry points do (``module:function``)."""
    strings = (node.value for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant))
    return {each.partition(":")[0] for each in strings if isinstance(each, str) and each.startswith("trace_dag.")}


def module_of(name: str) -> str:
    return name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def importers() -> dict[str, set[str]]:
    """The files that import or name a module, by the module's name."""
    found: dict[str, set[str]] = defaultdict(set)
    for folder in ("trace_dag", "tests", "lab"):
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            for module in imported(path) | named(path):
                found[module].add(path.relative_to(REPOSITORY).as_posix())
    return found


def nearest_tests(name: str, by: Mapping[str, set[str]]) -> set[str]:
    """The tests with the fewest imports between them and a changed file; quick ones if there are any."""
    seen, border = {name}, {name}
    while border:
        border = {each for file in border for each in by.get(module_of(file), ())} - seen
        seen |= border
        tests = {each for each in border if Path(each).name.startswith("test_")}
        if tests:
            return {each for each in tests if not each.startswith(SLOW)} or tests
    package = ".".join(Path(name).parts[:2])  # what nobody imports is found by an entry point
    beside = {each for module, files in by.items() if module.startswith(f"{package}.") for each in files}
    return {each for each in beside if Path(each).name.startswith("test_") and not each.startswith(SLOW)}


def main() -> None:
    files, by = sorted(changed()), importers()
    chosen: dict[str, None] = {}
    for name in files:
        if name.startswith("tests/") and Path(name).name.startswith("test_") and (REPOSITORY / name).exists():
            chosen[name] = None
        elif name.endswith(".py"):
            chosen |= dict.fromkeys(sorted(nearest_tests(name, by)))
    for name in files:
        if name.startswith("trace_dag/") and name.endswith(".py") and (REPOSITORY / name).exists():
            chosen["tests/assets/test_layers.py"] = None
            if ">>> " in (REPOSITORY / name).read_text():
                chosen[f"tests/test_doctests.py::test_the_examples_of_a_module_hold[{module_of(name)}]"] = None
    print("\n".join(chosen))


if __name__ == "__main__":
    main()
