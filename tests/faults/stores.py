"""An object store in memory that counts what it is asked and does wrong what it is told to."""

from __future__ import annotations

import errno
import hashlib
from collections import Counter
from collections.abc import Callable
from typing import ClassVar

import fsspec
from fsspec.implementations.memory import MemoryFileSystem

Fault = Callable[[str, str], None]


class TroubledStore(MemoryFileSystem):
    """Objects have an MD5 as S3's do. ``fault`` is called with each request's kind and path, and may raise;
    what is in ``cut_short`` is answered with its first half, once."""

    protocol = "troubled"
    cachable = False
    store: ClassVar[dict[str, object]] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]
    requests: ClassVar[Counter[str]] = Counter()
    fault: Fault | None = None
    cut_short: ClassVar[set[str]] = set()

    def _asked(self, kind: str, path: str) -> None:
        type(self).requests[kind] += 1
        if self.fault is not None:
            type(self).fault(kind, path)

    def cat_file(self, path: str, start: int | None = None, end: int | None = None, **options: object) -> bytes:
        self._asked("get", path)
        data = super().cat_file(path, start, end, **options)
        name = next((name for name in self.cut_short if path.endswith(name)), None)
        if name is None:
            return data
        self.cut_short.discard(name)
        return data[: len(data) // 2]

    def pipe_file(self, path: str, value: bytes, **options: object) -> None:
        self._asked("put", path)
        super().pipe_file(path, value, **options)

    def info(self, path: str, **options: object) -> dict[str, object]:
        self._asked("head", path)
        return super().info(path, **options)

    def ls(self, path: str, detail: bool = True, **options: object) -> list[dict[str, object]]:
        self._asked("list", path)
        rows = super().ls(path, detail=True, **options)
        return [row | {"ETag": f'"{self._md5(row)}"'} if row["type"] == "file" else row for row in rows]

    def _md5(self, row: dict[str, object]) -> str:
        return hashlib.md5(self.store[str(row["name"])].getvalue(), usedforsecurity=False).hexdigest()

    @classmethod
    def reset(cls) -> None:
        """Empty, well, and not yet asked anything."""
        cls.store.clear()
        cls.requests.clear()
        cls.fault = None
        cls.cut_short = set()


fsspec.register_implementation("troubled", TroubledStore, clobber=True)


def every(number: int, error: Exception, kinds: tuple[str, ...] = ("get", "put", "head", "list")) -> Fault:
    """A fault of every so-manieth request."""
    count = Counter[str]()

    def fail(kind: str, _path: str) -> None:
        if kind in kinds:
            count["asked"] += 1
            if count["asked"] % number == 0:
                raise error

    return fail


class ProviderError(Exception):
    """Not an OSError, as botocore's are not."""


NO_SPACE = OSError(errno.ENOSPC, "No space left on device")
