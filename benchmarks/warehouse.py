"""Time and memory that rebuilding the warehouse of a large cohort takes while a reader holds the old one open.

    python benchmarks/warehouse.py ROOT FOLDER [--crashes 15000]

The crashes of ROOT that were judged (a storage root on which real crashes have been run) are copied into FOLDER under
as many new keys as it takes: their reports, records and JSON artefacts are rewritten with the new key and their outcome
records with the new digests, the other files are linked. FOLDER is kept, and used again if it is there.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from trace_dag.cohorts.registry import Registry, ReportSource
from trace_dag.flow.records import Records, read_records, write_record
from trace_dag.flow.standing import valid_records
from trace_dag.stage import Stage
from trace_dag.storage import Storage, StoredFile
from trace_dag.warehouse.build import BuildReport, build_warehouse
from trace_dag.warehouse.query import open_warehouse

_FIRST_YEAR = 1975  # the first of FARS
_LIMIT_S, _LIMIT_BYTES = 60.0, 4 * 2**30


def main() -> None:
    """Make the cohort if need be, build, and rebuild beside a reader."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--crashes", type=int, default=15_000)
    options = parser.parse_args()
    if not (options.folder / "cohorts").is_dir():
        started = time.monotonic()
        make_cohort(Storage(options.root), Storage.open(options.folder), options.crashes)
        print(f"{options.crashes} crashes made in {time.monotonic() - started:.0f} s")
    first, _, _ = build(options.folder)
    print(f"first build    {first.duration_s:6.1f} s, {first.size / 1e6:.0f} MB")
    with reader(options.folder / "warehouse.duckdb") as counts:
        again, processor_s, peak_bytes = build(options.folder)
    print(f"rebuild        {again.duration_s:6.1f} s of {_LIMIT_S:.0f} s allowed, {again.rows['crashes']} crashes")
    print(f"processor      {processor_s:6.1f} s on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"peak memory    {peak_bytes / 2**30:6.2f} GiB of {_LIMIT_BYTES / 2**30:.0f} GiB allowed")
    print(f"reader         {len(counts)} queries meanwhile, all answered with {set(counts)} crashes")


def make_cohort(source: Storage, target: Storage, crashes: int) -> None:
    """Copies of the judged crashes of ``source`` under new keys."""
    stored = read_records(source, Registry(source).keys())
    judged = {key: valid for key, each in stored.items() if Stage.VERDICT in (valid := valid_records(each))}
    reports = {}
    for new, old in zip(new_keys(judged, crashes), _repeated(list(judged)), strict=False):
        reports[new] = copy_crash(source, target, old, new, judged[old])
    Registry(target).register("copies", reports)


def new_keys(judged: dict[str, Records], crashes: int) -> Iterator[str]:
    """Keys of the same length as the old ones, in the same states; round after round over the old keys."""
    for number in range(crashes):
        turn, position = divmod(number, len(judged))
        state = int(list(judged)[position].partition("-")[2]) // 10000
        yield f"{_FIRST_YEAR + turn}-{state * 10000 + position}"


def _repeated(keys: list[str]) -> Iterator[str]:
    while True:
        yield from keys


def copy_crash(source: Storage, target: Storage, old: str, new: str, records: Records) -> ReportSource:
    """One crash under a new key; its report as a source."""
    digests: dict[str, str] = {}  # of inputs, as later records name them
    report = ReportSource("stored", f"{Stage.RAW_REPORT}/{new}.xml")
    for stage, record in records.items():
        files = []
        for file in record.artefacts:
            name = file.name.replace(old, new)
            extension = name.partition(".")[2]
            copied = _copy(source, target, file, name, old, new)
            digests[f"{stage}.{extension}"] = copied.sha256
            files.append(copied)
        inputs = {name: digests.get(name, digest) for name, digest in record.provenance.inputs.items()}
        provenance = replace(record.provenance, inputs=inputs)
        write_record(
            target,
            replace(record, key=new, provenance=provenance, fingerprint=provenance.fingerprint, artefacts=tuple(files)),
        )
    return replace(report, sha256=digests[f"{Stage.RAW_REPORT}.xml"])


def _copy(source: Storage, target: Storage, file: StoredFile, name: str, old: str, new: str) -> StoredFile:
    if name.endswith(".json"):
        return target.write(name, source.read(file.name).replace(old.encode(), new.encode()))
    if name.startswith(f"{Stage.CRASH_RECORD}/"):
        table = pq.read_table(source.path(file.name))
        year, case = new.split("-")
        for column, value in {"key": new, "case_year": int(year), "state_case": int(case)}.items():
            field = table.schema.field(column)
            index = table.schema.get_field_index(column)
            table = table.set_column(index, field, pa.array([value], field.type))
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd", write_statistics=False, use_dictionary=False)  # as it is stored
        return target.write(name, sink.getvalue().to_pybytes())
    path = Path(target.path(name))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.hardlink_to(source.path(file.name))
    return StoredFile(name, file.size, file.sha256)


def build(folder: Path) -> tuple[BuildReport, float, int]:
    """Build in a process of its own; the report, its processor time in s, and the most memory it held, bytes."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_build, (folder,))


def _build(folder: Path) -> tuple[BuildReport, float, int]:
    started_s = time.process_time()
    report = build_warehouse(Storage(folder), folder)
    return report, time.process_time() - started_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class reader:  # noqa: N801 - used as a function
    """A process that holds a warehouse open and asks it again and again; what it was answered."""

    def __init__(self, path: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop, self._answers = context.Event(), context.Queue()
        self._process = context.Process(target=_ask, args=(path, self._stop, self._answers))
        self.counts: list[int] = []

    def __enter__(self) -> list[int]:
        self._process.start()
        self.counts.append(self._answers.get())
        return self.counts

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self.counts.extend(iter(self._answers.get, None))
        self._process.join()


def _ask(path: Path, stop: multiprocessing.Event, answers: multiprocessing.Queue) -> None:  # type: ignore[type-arg,valid-type]
    with open_warehouse(path) as connection:
        while not stop.is_set():
            row = connection.execute("SELECT count(*) FROM crashes").fetchone()
            answers.put(row[0] if row else 0)
            time.sleep(0.5)
    answers.put(None)


if __name__ == "__main__":
    main()
