"""The tests that a change touches, for ``./check --fast``: those changed, and those of and about changed modules.

Prints their paths, one per line. A change is what differs from the branch ``main`` (or from the last commit, on it),
uncommitted files included.
"""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
SLOW = ("tests/docs/", "tests/notebooks/", "tests/cli/", "tests/faults/", "tests/sample/")
"""Tests across everything, which take minutes: for ``./check``, unless they were changed themselves."""


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


def main() -> None:
    files = changed()
    modules = {name.removesuffix(".py").replace("/", ".") for name in files if name.endswith(".py")}
    chosen = []
    for path in sorted((REPOSITORY / "tests").rglob("test_*.py")):
        name = path.relative_to(REPOSITORY).as_posix()
        if name in files or (not name.startswith(SLOW) and imported(path) & modules):
            chosen.append(name)
    if any(name.startswith("trace_dag/") for name in files):
        chosen.append("tests/assets/test_layers.py")
    print("\n".join(dict.fromkeys(chosen)))


if __name__ == "__main__":
    main()
