"""A digest of the code that makes something: the modules it runs, directly or not, and the data they read.

A module counts with everything it imports, inside functions too, but not what it imports for type checkers alone (``if
TYPE_CHECKING:``); comments, docstrings and layout do not count. Data files count where a package's are read as
``importlib.resources.files("the.package")``, the package named outright: the way in which this package reads its own.

    python -m tests.code_digests    writes tests/code_digests.json anew
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from trace_dag.agents import evaluation_work
from trace_dag.agents import families as variations
from trace_dag.common.plugins import PluginKind, offered
from trace_dag.common.settings import Settings
from trace_dag.export import crash_files
from trace_dag.flow.stages import FLOW, VERSIONS
from trace_dag.warehouse import build

FILE = Path(__file__).with_name("code_digests.json")
_OWN = "trace_dag"
# What comes out of a module is the same however bytes are stored, fetched and waited for, and whichever other stages
# there are; settings enter a fingerprint by value.
_DECIDES_NOTHING = frozenset(
    f"trace_dag{name}"
    for name in [
        "",
        ".version",
        ".common.gc_pause",
        ".common.network.http",
        ".common.settings",
        ".common.storage.checksums",
        ".common.storage.files",
        ".flow.stages",
    ]
)


def numbers() -> dict[str, str]:
    """The number of each thing's code that is made again when it is raised."""
    return {
        **{stage.value: str(version) for stage, version in VERSIONS.items()},
        "warehouse": build.VERSION,
        "benchmark": crash_files.VERSION,
        "evaluations": evaluation_work.VERSION,
        "variations": variations.VERSION,
    }


def digests() -> dict[str, str]:
    """A digest of the code of each, all estimators, back-ends and converters of ours included."""
    found = {}
    for definition in FLOW.stages:
        readers = {each.reader for each in FLOW.inputs(definition).values() if each.reader}
        section = definition.section(Settings())
        kinds = [
            (info.json_schema_extra or {}).get("plugin")
            for info in (type(section).model_fields.values() if section is not None else ())
            if isinstance(info.json_schema_extra, dict)
        ]
        plugins = {each.module for kind in kinds if kind for each in offered(kind).values() if each.is_ours}
        modules = {name.partition(":")[0] for name in (definition.function, *readers)} | plugins
        found[definition.stage.value] = digest(modules)
    agents = {each.module for each in offered(PluginKind.AGENT).values() if each.is_ours}
    found["warehouse"] = digest({"trace_dag.warehouse.build"})
    found["benchmark"] = digest({"trace_dag.export.build"})
    found["evaluations"] = digest({"trace_dag.agents.evaluation.evaluate", *agents})
    found["variations"] = digest({"trace_dag.agents.variations.family"})
    return found


def recorded() -> dict[str, dict[str, str]]:
    """Number and digest of each as they are committed."""
    found: dict[str, dict[str, str]] = json.loads(FILE.read_text())
    return found


def digest(modules: Iterable[str]) -> str:
    """A digest of the code of some modules and of everything of this package that they import."""
    found = hashlib.sha256()
    data_of: set[str] = set()
    for module in sorted(_closure(modules)):
        source = _source(module)
        found.update(f"{module}\0{source.digest}\0".encode())
        data_of.update(source.data_of)
    for package in sorted(data_of):
        for name, data in _data_files(package):
            found.update(f"{name}\0{hashlib.sha256(data).hexdigest()}\0".encode())
    return found.hexdigest()[:16]


def _closure(modules: Iterable[str]) -> set[str]:
    """Modules with all they import of this package."""
    waiting = list(modules)
    found: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module in found or module in _DECIDES_NOTHING:
            continue
        found.add(module)
        if "." in module:
            waiting.append(module.rpartition(".")[0])  # importing a module runs the packages above it
        waiting += [name for name in _source(module).imports if name.partition(".")[0] == _OWN and _path_of(name)]
    return found


@cache
def _path_of(module: str) -> Path | None:
    """The source of a module; None if there is no such module."""
    top, *below = module.split(".")
    if not below:
        spec = importlib.util.find_spec(top)
        return Path(spec.origin) if spec is not None and spec.origin is not None else None
    above = _path_of(top)
    base = above.parent.joinpath(*below) if above else None
    if base is None:
        return None
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


def _data_files(package: str) -> Iterator[tuple[str, bytes]]:
    """Every file below a package that is not a code and in no package of its own, by name."""
    path = _path_of(package)
    if path is not None:
        for file in sorted(_files_below(path.parent)):
            yield f"{package}/{file.relative_to(path.parent).as_posix()}", file.read_bytes()


def _files_below(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.is_file() and path.suffix not in (".py", ".pyc"):
            yield path
        elif path.is_dir() and path.name != "__pycache__" and not (path / "__init__.py").exists():
            yield from _files_below(path)


@dataclass(frozen=True)
class _Source:
    """What a module's source says; ``digest`` is that of its code alone."""

    digest: str
    imports: tuple[str, ...]  # absolute names, of modules and of what is in them
    data_of: tuple[str, ...]  # packages whose data files it reads


class _Reader:
    """One walk over a module's code: what it says, and what it imports and reads."""

    def __init__(self, package: str) -> None:
        self.package = package
        self.said: list[str] = []
        self.imports: set[str] = set()
        self.data_of: set[str] = set()

    def read(self, node: ast.AST) -> None:
        """Take in a node and what is below it. Empty fields are left out: other Pythons have more or fewer of them."""
        kind = type(node)
        if kind in (ast.Import, ast.ImportFrom, ast.Call):
            self._note(node)
        said = self.said
        said.append(kind.__name__)
        for name in kind._fields:
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                said.append(name)
                self.read(value)
            elif isinstance(value, list):
                if value and not (name == "body" and isinstance(node, ast.If) and _is_for_type_checkers(node)):
                    said.append(name)
                    for each in value:
                        if not isinstance(each, ast.AST):
                            said.append(repr(each))
                        elif type(each) is not ast.Expr or not _is_text(each.value):
                            self.read(each)
            elif value is not None:
                said.append(f"{name}={value!r}")
        said.append(")")

    def _note(self, node: ast.AST) -> None:
        if isinstance(node, ast.Import):
            self.imports.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = self.package.rsplit(".", node.level - 1)[0] if node.level else ""
            base = ".".join(part for part in (above, node.module) if part)
            self.imports.update((base, *(f"{base}.{alias.name}" for alias in node.names)))
        elif isinstance(node, ast.Call) and node.args and _is_text(node.args[0]):
            called = node.func
            if (called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")) == "files":
                self.data_of.add(ast.literal_eval(node.args[0]))


def _is_text(node: ast.AST) -> bool:
    """A string. One that stands by itself says nothing: the docstring of a module, a class, a function, a constant."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _is_for_type_checkers(node: ast.If) -> bool:
    return (node.test.attr if isinstance(node.test, ast.Attribute) else getattr(node.test, "id", "")) == "TYPE_CHECKING"


@cache
def _source(module: str) -> _Source:
    path = _path_of(module)
    if path is None:
        return _Source("", (), ())
    reader = _Reader(module if path.name == "__init__.py" else module.rpartition(".")[0])
    reader.read(ast.parse(path.read_bytes(), filename=str(path)))
    said = hashlib.sha256("\0".join(reader.said).encode()).hexdigest()
    return _Source(said, tuple(sorted(reader.imports)), tuple(sorted(reader.data_of)))


if __name__ == "__main__":
    now = {name: {"number": number, "digest": digests()[name]} for name, number in numbers().items()}
    FILE.write_text(json.dumps(now, indent=1) + "\n")
