"""Deleting the files of crashes that are no longer registered."""

from __future__ import annotations

from collections.abc import Collection

from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.export.crash_files import FOLDER as BENCHMARK
from trace_dag.export.crash_files import FOLDERS_OF_CRASHES
from trace_dag.flow.manifests import Manifest, sound_manifest, write_manifest

_FOLDERS = (
    *(stage.value for stage in Stage),
    "reports",
    "pictures",
    *FOLDERS_OF_CRASHES,
)


def delete_artefacts(storage: Storage, keys: Collection[str]) -> int:
    """Delete every file of some crashes below the root and return the number.

    These are artefacts, records, copies of reports, and pages.
    """
    wanted = set(keys)
    names = [
        name
        for folder in _FOLDERS
        for name in storage.list(folder)
        if name.rpartition("/")[2].partition(".")[0] in wanted
    ]
    for name in names:
        storage.delete(name)
    before = sound_manifest(storage, BENCHMARK)
    if before.made_of.keys() & wanted:
        files = {name: file for name, file in before.files.items() if crash_of(name) not in wanted}
        made_of = {key: digest for key, digest in before.made_of.items() if key not in wanted}
        write_manifest(storage, BENCHMARK, Manifest(files, made_of))
    return len(names)
