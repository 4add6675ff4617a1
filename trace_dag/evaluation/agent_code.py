"""Which code an agent was, so that results of one that has changed can be told from those before."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path
from urllib.parse import parse_qsl

from trace_dag.code_versions import code_version


def agent_code(reference: str) -> str:
    """Digest of an agent, given as ``module:Class?name=value``: its module with what that imports of its own package
    and of this one, its arguments, and the bytes of files that they name. Nothing is imported.

    "unread" where the module is not a Python source.
    """
    place, _, arguments = reference.partition("?")
    try:
        code = code_version((place.partition(":")[0],)).digest
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return "unread"
    digest = hashlib.sha256(code.encode())
    for name, value in parse_qsl(arguments, keep_blank_values=True):
        digest.update(f"\0{name}\0{value}\0".encode())
        with suppress(OSError, ValueError), Path(value).open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:16]
