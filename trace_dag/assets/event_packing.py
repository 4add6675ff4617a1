"""Events of Dagster as they are stored: compressed one by one, with words that most of them share known beforehand.

An event is some 3 kB of JSON, nearly all of it the same names as in every other, and Dagster keeps it two or three
times. With ``event_words.txt``, which holds an event of each sort (zlib's preset dictionary, RFC 1950), a tenth is
left; by itself, compressed, it would be a third.

What is written can be read only with the same words: **the file never changes**. Better words would be a second file,
beside it. zlib says which words a text was packed with, by their checksum, and refuses others.
"""

from __future__ import annotations

import zlib
from functools import lru_cache
from importlib import resources
from typing import Any, Final

from sqlalchemy import Dialect, Engine, Text
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.types import TypeDecorator

_WORDS: Final = resources.files("trace_dag.assets").joinpath("event_words.txt").read_bytes()
_LEVEL: Final = 6
_REMEMBERED: Final = 512  # as many as Dagster hands over at once; 2 MB


@lru_cache(maxsize=_REMEMBERED)
def packed(text: str) -> bytes:
    """A text, compressed. The last ones are remembered: an event is written into two files.

    >>> unpacked(packed("STEP_START"))
    'STEP_START'
    """
    compressor = zlib.compressobj(_LEVEL, zdict=_WORDS)
    return compressor.compress(text.encode()) + compressor.flush()


def unpacked(data: bytes) -> str:
    """What :func:`packed` was given. Raises :class:`zlib.error` for anything else."""
    decompressor = zlib.decompressobj(zdict=_WORDS)
    text = decompressor.decompress(data)
    if not decompressor.eof:
        raise zlib.error("it ends too early")
    return text.decode()


def pack_events_of(engine: Engine) -> None:
    """From now on this engine packs what it writes into :class:`PackedText`, and unpacks what it reads."""
    engine.dialect.packs_events = True  # type: ignore[attr-defined]


class PackedText(TypeDecorator[str]):
    """A text column that holds packed text where :func:`pack_events_of` was told so, elsewhere plain text.

    Dagster's tables are the same objects for all event logs of a process, and one that is not ours stays as it is. In
    SQLite, text columns take bytes as they are.
    """

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> Any:
        """What is stored of a text."""
        return value if value is None or not hasattr(dialect, "packs_events") else packed(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> str | None:
        """The text that was stored. Raises :class:`SQLAlchemyError`, as for any other damage of a database."""
        try:
            return value if value is None or not hasattr(dialect, "packs_events") else unpacked(value)
        except zlib.error as error:
            raise SQLAlchemyError(f"an event cannot be read ({error})") from error
