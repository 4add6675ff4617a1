"""Plug-ins that installed packages offer by name, and functions named as ``module:function``.

Back-ends, converters, estimators, agents, exporters, sources of reports and maps.

Each kind is a group of entry points (``trace_dag.backends``); what this package offers is registered in the same
way. The interface of each kind is defined where it is used; see the page on extending in the documentation."""

from __future__ import annotations

import ast
import importlib.util
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib import import_module, metadata
from operator import attrgetter
from pathlib import Path
from typing import Any

from trace_dag.common.errors import UserError


class PluginKind(StrEnum):
    """The kinds of plugins; the value is the last part of the group of entry points."""

    AGENT = "agents"
    EXPORTER = "exporters"
    BACKEND = "backends"
    CONVERTER = "converters"
    ESTIMATOR = "estimators"
    REPORT_SOURCE = "report_sources"
    MAP_SOURCE = "map_sources"

    @property
    def group(self) -> str:
        """Return the group of entry points."""
        return f"trace_dag.{self.value}"


@dataclass(frozen=True)
class Plugin:
    """Something offered under a name: ``module:attribute``, and the package and version it comes with."""

    kind: PluginKind
    name: str
    reference: str
    package: str
    version: str

    @property
    def module(self) -> str:
        """Return the module it is in."""
        return self.reference.partition(":")[0]

    @property
    def is_ours(self) -> bool:
        """Return whether it is a part of this package."""
        return self.module.partition(".")[0] == "trace_dag"


@cache  # every kind is asked for, and each reading looks at all packages
def _installed() -> Any:
    return metadata.entry_points()


@cache
def list_plugins(kind: PluginKind) -> dict[str, Plugin]:
    """Return all installed plugins of a kind by name, without importing them."""
    found = {}
    for point in _installed().select(group=kind.group):
        package, version = (point.dist.name, point.dist.version) if point.dist else ("", "")
        found[point.name] = Plugin(kind, point.name, point.value, package, version)
    return dict(sorted(found.items()))


def plugin(kind: PluginKind, name: str) -> Plugin:
    """Return the plugin of that name.

    Raises :class:`UserError` that lists the known names.
    """
    there_are = list_plugins(kind)
    if name in there_are:
        return there_are[name]
    what = kind.value.replace("_", " ").removesuffix("s")
    if not there_are:  # a checkout that was brought up to date after it was installed
        raise UserError(
            f"this installation has no {what}, not even those of the package; install it again (pip install -e .)"
        )
    raise UserError(
        f"no {what} {name!r} is installed; expected one of {', '.join(there_are)} (trace-dag plugins lists them)"
    )


def load(kind: PluginKind, name: str) -> Any:
    """Import and return the object of a plugin.

    Raises :class:`UserError` if that fails.
    """
    found = plugin(kind, name)
    module, _, attribute = found.reference.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise UserError(f"{kind.value} {name} ({found.package} {found.version}) cannot be loaded: {error}") from error


# --- functions by name -----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Parameter:
    """One parameter of a function, with its annotation as written."""

    name: str
    annotation: str


@dataclass(frozen=True)
class Signature:
    """The parameters and the result of a function, as annotated."""

    parameters: tuple[Parameter, ...]
    returns: str


@cache
def signature_of(reference: str) -> Signature:
    """Return the signature of ``module:function``, read from its source; importing could take a second."""
    module, _, name = reference.partition(":")
    spec = importlib.util.find_spec(module)
    for node in ast.parse(Path(spec.origin).read_bytes()).body if spec is not None and spec.origin is not None else ():
        if isinstance(node, ast.FunctionDef) and node.name == name:
            asked = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            parameters = tuple(Parameter(each.arg, _written(each.annotation)) for each in asked)
            return Signature(parameters, _written(node.returns))
    raise ValueError(f"{reference}: there is no such function")


def resolve_reference(reference: str) -> Any:
    """Import and return the object named ``module:name``, or ``module:name.attribute``."""
    module, _, name = reference.partition(":")
    return attrgetter(name)(import_module(module))


def _written(node: ast.expr | None) -> str:
    return "" if node is None else ast.unparse(node)
