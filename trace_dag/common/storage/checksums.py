"""Documents and tables that show whether they have been changed: their ``checksum`` is the SHA-256 of all the rest.

It finds damage and changes by hand. It is no signature: whoever changes a document can make its checksum anew. Every
other stored file is listed, with size and SHA-256, in such a document: an outcome record
(:mod:`trace_dag.common.provenance`) or the manifest of its folder (:mod:`trace_dag.flow.manifests`).
"""

from __future__ import annotations

import hashlib
import io
import json
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import DamagedFile
from trace_dag.common.schemas import table_from_parquet

if TYPE_CHECKING:
    import pyarrow as pa

_FIELD = "checksum"
_BLANK = b"-" * 64  # in place of a table's checksum while it is computed
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

    Raises :class:`DamagedFile` if the checksum is missing or wrong.

    >>> check_document(add_checksum(b'{"a": 1}'), name="a.json")
    {'a': 1}
    """
    try:
        content = dict(json.loads(data))
    except (ValueError, TypeError, RecursionError) as error:
        raise DamagedFile(name, f"not a JSON object ({error})") from error
    said = content.pop(_FIELD, None)
    if said != _of(content) and not (said is None and content.pop(_OLDER, None)):
        raise DamagedFile(name, "its content has changed since it was written")
    return content


def write_table(table: pa.Table, about: bytes = b"") -> bytes:
    """Return a Parquet file of a table, with its checksum and the text ``about``."""
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    stamped = table.replace_schema_metadata({"about": about, _FIELD: _BLANK})
    pq.write_table(stamped, buffer, compression="zstd")
    data = buffer.getvalue()
    at = data.rindex(_BLANK)
    return data[:at] + hashlib.sha256(data).hexdigest().encode() + data[at + len(_BLANK) :]


def check_table(data: bytes, *, name: str) -> tuple[pa.Table, bytes]:
    """Return the table of a Parquet file and its text.

    Raises :class:`DamagedFile` if the checksum is missing or wrong.
    """
    import pyarrow as pa

    try:
        table = table_from_parquet(data)
        said = (table.schema.metadata or {})[_FIELD.encode()]
        at = data.rindex(said)
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        raise DamagedFile(name, f"not a table with a checksum ({error})") from error
    if hashlib.sha256(data[:at] + _BLANK + data[at + len(said) :]).hexdigest().encode() != said:
        raise DamagedFile(name, "its content has changed since it was written")
    return table, table.schema.metadata[b"about"]


def _of(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
