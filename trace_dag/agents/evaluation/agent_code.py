"""Identity of an agent's code, so that results of a changed agent can be kept apart from earlier ones."""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import parse_qsl


def agent_code(reference: str) -> str:
    """Return the digest of an agent, given as ``module:Class?name=value``.

    It covers the sources of the agent's package (for an agent of trace-dag only its module), its arguments, and the
    bytes of files that the arguments name. The result is "unread" if the module is not a Python source.
    """
    place, _, arguments = reference.partition("?")
    digest = hashlib.sha256()
    try:
        for path in _sources(place.partition(":")[0]):
            digest.update(path.read_bytes() + b"\0")
    except (OSError, ValueError, ImportError):
        return "unread"
    for name, value in parse_qsl(arguments, keep_blank_values=True):
        digest.update(f"\0{name}\0{value}\0".encode())
        with suppress(OSError, ValueError), Path(value).open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:16]


def _sources(module: str) -> Iterator[Path]:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        raise ImportError(f"{module}: no Python source")
    path = Path(spec.origin)
    alone = module.startswith("trace_dag.") or ("." not in module and path.name != "__init__.py")
    yield from [path] if alone else sorted(path.parent.rglob("*.py"))
