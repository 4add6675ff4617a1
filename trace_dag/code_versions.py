"""Which code makes something: a digest of the modules it runs, and the libraries that decide with them.

Belongs here: reading sources without importing them: what a module imports, directly or not, inside functions too; what
its code is apart from comments, docstrings and layout; which data files of the package it reads; what a function asks
for. Does not belong here: what a result is made from beside its code (:mod:`trace_dag.provenance`).

A module counts with everything it imports, but not what it imports for type checkers alone (``if TYPE_CHECKING:``).
Data files count where a package's are read as ``importlib.resources.files("the.package")``, the package named outright:
the way in which this package reads all of its own.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from trace_dag.version import __version__

_OWN = "trace_dag"
# What comes out of a module is the same however bytes are stored, fetched and waited for, and whichever other stages
# there are; settings enter a fingerprint by value.
_DECIDES_NOTHING = frozenset(
    {
        "trace_dag",
        "trace_dag.version",
        "trace_dag.garbage",
        "trace_dag.http",
        "trace_dag.flow.stages",
        "trace_dag.settings",
        "trace_dag.checksums",
        "trace_dag.storage",
        "fsspec",
        "httpx",
        "litellm",
        "tenacity",
    }
)
_PROJECT_NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True)
class CodeVersion:
    """``digest``: ``0.1.0+`` and a digest of the sources; ``libraries``: versions of third-party ones by name."""

    digest: str
    libraries: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        """Both in one line."""
        return ", ".join([self.digest, *(f"{name} {version}" for name, version in self.libraries.items())])


@dataclass(frozen=True)
class Parameter:
    """One parameter of a function, with its annotation as written."""

    name: str
    annotation: str


@dataclass(frozen=True)
class Signature:
    """What a function asks for and what it gives, as written."""

    parameters: tuple[Parameter, ...]
    returns: str


@cache
def code_version(modules: tuple[str, ...], chosen: tuple[str, ...] = ()) -> CodeVersion:
    """Version of the code of some modules and of everything they import.

    ``chosen`` are modules that a setting brings in: of what they import the libraries of this package's extras count.
    """
    digest = hashlib.sha256()
    ours, libraries = _closure((*modules, *chosen))
    optional = _optional_libraries()
    libraries = libraries - optional | (_closure(chosen)[1] & optional)
    data_of: set[str] = set()
    for module in sorted(ours):
        source = _source(module)
        digest.update(f"{module}\0{source.digest}\0".encode())
        data_of.update(source.data_of)
    for package in sorted(data_of):
        for name, data in _data_files(package):
            digest.update(f"{name}\0{hashlib.sha256(data).hexdigest()}\0".encode())
    _keep_what_was_read()
    versions = {
        name: version
        for name in sorted(libraries)
        if (version := library_version(name) or ("not installed" if name in optional else None))
    }
    return CodeVersion(f"{__version__}+{digest.hexdigest()[:16]}", versions)


@cache
def signature_of(reference: str) -> Signature:
    """The signature of ``module:function``, read without importing the module."""
    module, _, name = reference.partition(":")
    path = _path_of(module)
    for node in ast.parse(path.read_bytes()).body if path else ():
        if isinstance(node, ast.FunctionDef) and node.name == name:
            asked = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            parameters = tuple(Parameter(each.arg, _written(each.annotation)) for each in asked)
            return Signature(parameters, _written(node.returns))
    raise ValueError(f"{reference}: there is no such function")


def referred(reference: str) -> Any:
    """What ``module:name`` names, its module imported."""
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)


@cache
def library_version(name: str) -> str | None:
    """The installed version of the library that ``import name`` takes; None where there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        found = _distribution_with(name)
        return found.version if found else None


def _distribution_with(module: str) -> metadata.Distribution | None:
    """The installed package that has a top-level module of that name.

    ``metadata.packages_distributions`` finds the same, but parses the lists of files of all packages: that took an
    eighth of the time of a run with nothing to do.
    """
    file = re.compile(rf'^"?{re.escape(module)}(?:/|\.py,)', re.MULTILINE)
    for package in metadata.distributions():
        named = (package.read_text("top_level.txt") or "").split()
        if module in named or (not named and file.search(package.read_text("RECORD") or "")):
            return package
    return None


# --- what belongs to a version ----------------------------------------------------------------------------------------
def _closure(modules: Iterable[str]) -> tuple[set[str], set[str]]:
    """Modules with all they import of their own packages and of this one, and the libraries they import."""
    waiting = list(modules)
    packages = {_OWN, *(module.partition(".")[0] for module in waiting)}
    found: set[str] = set()
    libraries: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module in found or module in _DECIDES_NOTHING:
            continue
        found.add(module)
        if "." in module:
            waiting.append(module.rpartition(".")[0])  # importing a module runs the packages above it
        for name in _source(module).imports:
            top = name.partition(".")[0]
            if top in packages:
                waiting.extend([name] if _path_of(name) else [])
            elif top not in sys.stdlib_module_names and top not in _DECIDES_NOTHING:
                libraries.add(top)
    return found, libraries


@cache
def _optional_libraries() -> frozenset[str]:
    """Libraries of this package's extras: they count where a setting chooses them, not wherever they are installed."""
    required: dict[bool, set[str]] = {True: set(), False: set()}
    try:
        requirements = metadata.requires("trace-dag") or []
    except metadata.PackageNotFoundError:  # run from its sources
        requirements = []
    for each in requirements:
        name = _PROJECT_NAME.match(each)
        required["extra ==" in each].add(name[0].lower() if name else each)
    return frozenset(required[True] - required[False])


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


# --- reading a source -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Source:
    """What a module's source says. ``content`` is the digest of its bytes, ``digest`` that of its code alone."""

    content: str
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


def _written(node: ast.expr | None) -> str:
    return "" if node is None else ast.unparse(node)


@cache
def _source(module: str) -> _Source:
    path = _path_of(module)
    if path is None:
        return _Source("", "", (), ())
    data, kept = path.read_bytes(), _kept()
    content = hashlib.sha256(data).hexdigest()
    if module not in kept or kept[module].content != content:
        reader = _Reader(module if path.name == "__init__.py" else module.rpartition(".")[0])
        reader.read(ast.parse(data, filename=str(path)))
        kept[module] = _Source(
            content=content,
            digest=hashlib.sha256("\0".join(reader.said).encode()).hexdigest(),
            imports=tuple(sorted(reader.imports)),
            data_of=tuple(sorted(reader.data_of)),
        )
        _new.add(module)
    return kept[module]


# --- sources as read, kept by their content so that only what has changed is parsed again -----------------------------
_KEPT: TypeAdapter[dict[str, _Source]] = TypeAdapter(dict[str, _Source])
_new: set[str] = set()  # read by this process and not kept yet


def _kept_at() -> Path:
    """In the user's cache, one file for each installation and version of this module. It can be deleted at any time."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    mine = hashlib.sha256(__file__.encode() + Path(__file__).read_bytes() + sys.version.encode()).hexdigest()
    return Path(base) / "trace-dag" / f"code-{mine[:16]}.json"


@cache
def _kept() -> dict[str, _Source]:
    try:
        return _KEPT.validate_json(_kept_at().read_bytes())
    except (OSError, RuntimeError, ValidationError):  # RuntimeError: a user without a home
        return {}


def _keep_what_was_read() -> None:
    if not _new:
        return
    _new.clear()
    try:
        target = _kept_at()
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".writing-", delete=False) as file:
            file.write(_KEPT.dump_json(_kept()))
        Path(file.name).replace(target)
    except (OSError, RuntimeError):
        pass  # where nothing can be written every process reads the sources for itself
