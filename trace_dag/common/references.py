"""Functions named as ``module:function``: what they ask for, without importing them, and themselves."""

from __future__ import annotations

import ast
import importlib.util
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


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
    """Import and return the object named ``module:name``."""
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)


def _written(node: ast.expr | None) -> str:
    return "" if node is None else ast.unparse(node)
