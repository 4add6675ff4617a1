"""Whether pages and packages are as they were made, and mending those that are not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from trace_dag.benchmark.build import SUBJECT, not_as_made, page_name
from trace_dag.errors import DamagedFile
from trace_dag.flow.ledgers import read_ledger
from trace_dag.flow.verify import Disagreement, DisagreementKind
from trace_dag.provenance import crash_of
from trace_dag.storage import Storage


def verify_benchmark(storage: Storage, *, contents: bool = False) -> Iterator[Disagreement]:
    """Pages and packages that are not as their ledger says; with ``contents`` every file is read."""
    try:
        ledger = read_ledger(storage, SUBJECT)
    except DamagedFile as damaged:
        yield Disagreement(DisagreementKind.DAMAGED_PAGE, str(damaged), file=damaged.name)
        return
    for file, detail in not_as_made(storage, ledger, contents=contents):
        key = crash_of(file.name)
        yield Disagreement(
            DisagreementKind.DAMAGED_PAGE, detail, key if key in ledger.made_of else None, file=file.name
        )


def repair_benchmark(storage: Storage, found: Iterable[Disagreement]) -> None:
    """Delete what is damaged, so that building the benchmark makes it again."""
    for each in found:
        if each.kind is DisagreementKind.DAMAGED_PAGE and each.file:
            storage.delete(each.file)
            if each.key is not None:
                storage.delete(page_name(each.key))  # whose lack is seen without asking for single files
