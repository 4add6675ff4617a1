"""Verification and repair of pages and packages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from trace_dag.common.errors import DamagedFile
from trace_dag.common.provenance import crash_of
from trace_dag.common.storage.files import Storage
from trace_dag.export.build import page_name
from trace_dag.export.crash_files import FOLDER, FOLDERS_OF_CRASHES
from trace_dag.flow.manifests import manifest_name, not_as_listed, read_manifest
from trace_dag.flow.verify import Disagreement, DisagreementKind, Quarantine


def verify_benchmark(storage: Storage, *, contents: bool = False) -> Iterator[Disagreement]:
    """Yield pages and packages that differ from their manifest; ``contents`` compares the bytes as well.

    Without a readable manifest every file counts as suspect.
    """
    name = manifest_name(FOLDER)
    there = [each for folder in (FOLDER, *FOLDERS_OF_CRASHES) for each in storage.list(folder) if each != name]
    try:
        manifest = read_manifest(storage, FOLDER)
        if there and not manifest.files:
            raise DamagedFile(name, "it is not there")
    except DamagedFile as damaged:
        yield Disagreement(DisagreementKind.DAMAGED_PAGE, str(damaged), file=name)
        for each in there:
            yield Disagreement(DisagreementKind.DAMAGED_PAGE, f"{name} does not say whether {each} is whole", file=each)
        return
    for file, detail in not_as_listed(storage, manifest.files.values(), contents=contents):
        key = crash_of(file.name)
        yield Disagreement(
            DisagreementKind.DAMAGED_PAGE, detail, key if key in manifest.made_of else None, file=file.name
        )
    for each in there:
        if each not in manifest.files:
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{each} is not in {name}", file=each)


def repair_benchmark(found: Iterable[Disagreement], aside: Quarantine) -> None:
    """Put damaged files aside, so that the next build of the benchmark makes them again."""
    for each in found:
        if each.kind is DisagreementKind.DAMAGED_PAGE and each.file:
            aside.move(each.file, each.detail)
            if each.key is not None:  # its page goes too: its lack is seen without asking for single files
                aside.move(page_name(each.key), each.detail)
