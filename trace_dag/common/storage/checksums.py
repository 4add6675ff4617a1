"""JSON documents that show whether they have been changed: their field ``checksum`` is the SHA-256 of all the others.

It finds damage and changes by hand. It is no signature: whoever changes a document can make its checksum anew. Every
other stored file is listed, with size and SHA-256, in such a document: an outcome record
(:mod:`trace_dag.common.provenance`) or the manifest of its folder (:mod:`trace_dag.flow.manifests`).
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

from trace_dag.common.errors import DamagedFile

_FIELD = "checksum"
_OLDER = "sha256"  # documents of the versions before had a SHA-256 of their bytes in this field


def add_checksum(document: bytes) -> bytes:
    """Return a JSON object with its checksum.

    >>> list(json.loads(add_checksum(b'{"a": 1}')))
    ['a', 'checksum']
    """
    content = json.loads(document)
    return json.dumps({**content, _FIELD: _of(content)}, indent=1, ensure_ascii=False).encode()


def check_document(data: bytes, *, name: str) -> dict[str, Any]:
    """Return the fields of a document without its checksum.

    Raises :class:`DamagedFile` if it has none, or another.

    >>> check_document(add_checksum(b'{"a": 1}'), name="a.json")
    {'a': 1}
    """
    try:
        content = dict(json.loads(data))
    except (ValueError, TypeError, RecursionError) as error:
        raise DamagedFile(name, f"not a JSON object ({error})") from error
    said = content.pop(_FIELD, None)
    if said != _of(content) and not (said is None and content.pop(_OLDER, None)):
        raise DamagedFile(name, "its content is not the one it was written with")
    return content


def _of(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
