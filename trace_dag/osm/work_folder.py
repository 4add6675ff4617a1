"""Files that only grow, with a note of how far they are whole: what an interrupted pass over a large map leaves."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final, Self

_NOTE: Final = "note.json"


class WorkFolder:
    """A folder of such files. ``done`` steps of the work are in them, and ``facts`` (JSON) were noted with the last.

    What was written after the last note is cut off when the folder is opened again, and all of it is dropped where it
    was ``made_from`` something else.
    """

    def __init__(self, folder: Path, made_from: str) -> None:
        self.folder = folder
        self._made_from = made_from
        self._open: dict[str, BinaryIO] = {}
        self.done = 0
        self.facts: dict[str, Any] = {}
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        note = self._noted()
        if note is None:
            self.clear()
            return
        self.done, self.facts = note["done"], note["facts"]
        for file in folder.iterdir():
            if file.name in note["sizes"]:
                os.truncate(file, note["sizes"][file.name])
            elif file.name != _NOTE:
                file.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for file in self._open.values():
            file.close()

    def path(self, name: str) -> Path:
        """A file of the folder."""
        return self.folder / name

    def append(self, name: str, data: bytes) -> None:
        """Write at the end of a file."""
        if name not in self._open:
            self._open[name] = self.path(name).open("ab")
        self._open[name].write(data)

    def note(self, done: int, facts: Mapping[str, Any], others: Mapping[str, int]) -> None:
        """``done`` steps are in the files, all on the disk by then; ``others`` are sizes of those somebody else writes,
        bytes."""
        sizes = dict(others)
        for name, file in self._open.items():
            file.flush()
            sizes[name] = file.tell()
        for name in sizes:
            with self.path(name).open("rb+") as file:
                os.fsync(file.fileno())
        self.done, self.facts = done, dict(facts)
        text = json.dumps({"made_from": self._made_from, "done": done, "sizes": sizes, "facts": self.facts})
        written = self.path(f"{_NOTE}.new")
        written.write_text(text)
        written.replace(self.path(_NOTE))

    def remove(self) -> None:
        """Delete the folder: all that was in it is somewhere else."""
        self.__exit__()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _noted(self) -> dict[str, Any] | None:
        """The last note; None if there is none that the files still agree with."""
        try:
            note = json.loads(self.path(_NOTE).read_bytes())
            made_from, sizes = note["made_from"], note["sizes"]
            whole = all(self.path(name).stat().st_size >= size for name, size in sizes.items())
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return note if whole and made_from == self._made_from else None

    def clear(self) -> None:
        """Begin anew."""
        self.__exit__()
        self._open.clear()
        self.done, self.facts = 0, {}
        for file in self.folder.iterdir():
            file.unlink()
