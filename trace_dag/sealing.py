"""JSON documents that show whether they have been changed: their last field is the SHA-256 of everything before it.

Belongs here: setting and checking that seal. Every other stored file is listed, with size and SHA-256, in a sealed
document: an outcome record (:mod:`trace_dag.provenance`) or a ledger (:mod:`trace_dag.flow.ledgers`). A seal finds
damage and changes by hand; it is not a signature and keeps nobody from sealing anew.
"""

from __future__ import annotations

import hashlib
import re

from trace_dag.errors import DamagedFile

_END = re.compile(rb"\s*}\s*$")
_SEAL = re.compile(rb',?\s*"sha256"\s*:\s*"([^"]*)"\s*}\s*$')
_SEAL_BYTES = 120  # at most, with its white space: long documents are not searched


def sealed(document: bytes) -> bytes:
    """A JSON object with its seal as the last field.

    >>> sealed(b'{"a": 1}')[:12]
    b'{"a": 1,\\n "s'
    """
    body = _END.sub(b"", document)
    comma = b"" if body.endswith(b"{") else b","
    return body + comma + b'\n "sha256": "' + hashlib.sha256(body).hexdigest().encode() + b'"\n}'


def unsealed(data: bytes, *, name: str) -> bytes:
    """The document without its seal. One that has none is given back as it is: whether it has to have one, and whether
    it is JSON at all, is for its reader to say. Raises :class:`DamagedFile` for a broken seal.

    >>> unsealed(sealed(b'{"a": 1}'), name="a.json")
    b'{"a": 1\\n}'
    """
    start = max(len(data) - _SEAL_BYTES, 0)
    seal = _SEAL.search(data, start)
    if seal is None:
        return data
    body = data[: seal.start()]
    if hashlib.sha256(body).hexdigest().encode() != seal[1]:
        raise DamagedFile(name, "its content is not the one it was written with")
    return body + b"\n}"


def is_sealed(data: bytes) -> bool:
    """Whether a document ends in a seal, broken or not.

    >>> is_sealed(sealed(b'{"a": 1}')), is_sealed(b'{"a": 1}')
    (True, False)
    """
    return _SEAL.search(data, max(len(data) - _SEAL_BYTES, 0)) is not None
