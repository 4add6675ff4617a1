"""What is published: the same bytes whoever builds it, and nothing installed with it under a licence that surprises."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from touched import imported

REPOSITORY = Path(__file__).resolve().parents[1]
BUILT_FROM = ("pyproject.toml", "README.md", "LICENSE", "trace_dag", "data")


def built(folder: Path, *, copied_s: int, umask: int) -> bytes:
    """The wheel of a copy of the sources, whose files were copied at another time by somebody with other habits."""
    before = os.umask(umask)
    try:
        for name in BUILT_FROM:
            copied = shutil.copytree if (REPOSITORY / name).is_dir() else shutil.copyfile
            folder.mkdir(exist_ok=True)
            copied(REPOSITORY / name, folder / name)
        for path in folder.rglob("*"):
            os.utime(path, (copied_s, copied_s))
        subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", "out"],
            cwd=folder,
            env=os.environ | {"SOURCE_DATE_EPOCH": "1700000000"},
            check=True,
            capture_output=True,
        )
    finally:
        os.umask(before)
    (wheel,) = (folder / "out").glob("*.whl")
    return wheel.read_bytes()


def test_two_builds_of_the_wheel_are_the_same_bytes(tmp_path: Path) -> None:
    first = built(tmp_path / "first", copied_s=1_000_000_000, umask=0o022)
    second = built(tmp_path / "second", copied_s=1_600_000_000, umask=0o077)
    assert first == second
    assert len(first) > 1_000_000


@pytest.mark.parametrize(("arguments", "code"), [([], 0), (["--allow-only", "MIT"], 1)])
def test_the_licence_of_all_that_is_installed_is_one_of_the_list(arguments: list[str], code: int) -> None:
    command = [str(Path(sys.executable).with_name("pip-licenses")), *arguments]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    if code == 0:
        assert '"mujoco"' in done.stdout


def test_imports_are_declared_dependencies() -> None:
    """Imports within functions too: those of what only developers install break on a user's machine."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    extras = {name: each for name, each in project["optional-dependencies"].items() if name not in ("dev", "docs")}
    wanted = [*project["dependencies"], *(each for extra in extras.values() for each in extra)]
    known = {re.split(r"[\[<>=]", each)[0].strip().lower().replace("_", "-") for each in wanted}
    owners = packages_distributions()
    foreign: dict[str, set[str]] = {}
    for path in (REPOSITORY / "trace_dag").rglob("*.py"):
        for module in imported(path):
            name = module.partition(".")[0]
            of = {each.lower().replace("_", "-") for each in owners.get(name, ())}
            if name not in sys.stdlib_module_names and name != "trace_dag" and not of & known:
                foreign.setdefault(name, set()).add(path.relative_to(REPOSITORY).as_posix())
    come_with_others = {"pydantic_core", "sqlalchemy", "yaml", "_typeshed"}  # pydantic, dagster, dagster, type checkers
    assert {name: paths for name, paths in foreign.items() if name not in come_with_others} == {}
