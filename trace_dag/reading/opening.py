"""Kinds of places: a storage root, a package or a release."""

from __future__ import annotations

import os
from pathlib import Path

from trace_dag.common.errors import UserError
from trace_dag.flow.workspace import Workspace, storage_root
from trace_dag.reading.crashes import Crashes, Home
from trace_dag.reading.packed import ArchiveFiles, FolderFiles, list_packages


def open_place(place: str | os.PathLike[str] | None) -> Crashes:
    """See :func:`trace_dag.open`."""
    text = storage_root() if place is None else os.fspath(place)
    if "://" in text and not text.startswith("file://"):
        return Home(Workspace.open(text, to_read=True))
    path = Path(text.removeprefix("file://")).expanduser()
    if path.is_file():
        found = list_packages(ArchiveFiles.of(path, str(path)))
        if found is None:
            raise UserError(f"{path}: an archive without {_EXPECTED}")
        return found
    if not path.is_dir():
        raise UserError(f"{path}: there is nothing; trace-dag demo makes {storage_root()} with the bundled sample")
    packed = list_packages(FolderFiles(path))
    if packed is not None:
        return packed
    if not (path / "cohorts").is_dir():
        raise UserError(f"{path}: a folder without {_EXPECTED}, and no storage root: no crash is registered in it")
    return Home(Workspace.open(str(path), to_read=True))


_EXPECTED = "manifest.json (a package) or index.parquet (a release)"
