"""A version of the benchmark, brought together from the warehouse and the packages.

Packages go through memory one at a time. An interrupted release resumes; a complete version is never changed. Belongs
here: copying the files. Does not belong here: the contents of the documents (:mod:`trace_dag.export.release_files`).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trace_dag.agents.evaluation.shares import effective_number
from trace_dag.agents.evaluation.splits import splits_of
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.messages.wording import count_of, last_line
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.export.build import build_benchmark
from trace_dag.export.crash_files import FOLDER, package_name
from trace_dag.export.export import write_if_changed
from trace_dag.export.packaging import map_attribution
from trace_dag.export.release_files import (
    CHECKSUMS,
    NAME,
    ArchiveFormat,
    BenchmarkRelease,
    checksums,
    read_checksums,
    release_documents,
    write_archive,
)
from trace_dag.export.release_metadata import FILE, definition, differences, read_definition
from trace_dag.flow.manifests import read_manifest
from trace_dag.flow.records import OnProblem, raise_problem, read_records
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse import query
from trace_dag.warehouse.national import classes_of, national_margins, rake

_VERSION = re.compile(r"[0-9]+(\.[0-9]+){0,2}([.-]?(a|b|rc|dev)[0-9]+)?")
# Everything the index says of a package but where it is.
_PACKED = """
SELECT crashes.*, catalogue.* EXCLUDE (key), verdicts.* EXCLUDE (key), bodies.* EXCLUDE (key),
    estimates.estimator, estimates.asked_estimator, estimates.fallback_reason, estimates.ambiguity,
    simulations.backend || ' ' || simulations.backend_version AS backend
FROM crashes
JOIN verdicts USING (key)
JOIN catalogue USING (key)
LEFT JOIN estimates USING (key)
LEFT JOIN simulations ON simulations.key = crashes.key AND simulations.hypothesis = verdicts.hypothesis
LEFT JOIN (
    SELECT key, string_agg(vehicle_class, ', ' ORDER BY vehicle_number) AS vehicle_classes,
        count(travel_speed_mps) AS speeds_reported
    FROM vehicles WHERE in_transport GROUP BY key
) AS bodies USING (key)
WHERE crashes.final_state IN ('verified', 'first_event_only')
ORDER BY crashes.key
"""


@dataclass(frozen=True)
class ReleaseReport:
    """The folder of a release, the number of its packages, and of the files written now.

    ``missing`` crashes could not be packed: the release is not finished.
    """

    folder: Path
    archive: Path | None
    packages: int
    written: int
    missing: int = 0


def check_version(version: str) -> None:
    """Raise :class:`UserError` for a version that is not of the form 1.2 or 1.2.3."""
    if not _VERSION.fullmatch(version):
        raise UserError(f"version {version!r}: expected a version such as 1, 1.2, 1.2.3 or 2.0-rc1")


def build_release(
    workspace: Workspace,
    version: str,
    output: Path,
    *,
    cohort: str | None = None,
    archive: ArchiveFormat | None = None,
    bench: Path | None = None,
    national: Sequence[Path] = (),
    unknown: Collection[str] = (),
    on_problem: OnProblem = raise_problem,
) -> ReleaseReport:
    """Release the accepted crashes, of one cohort or all, as ``<output>/trace-dag-benchmark-<version>``.

    Packages are first brought up to date with the warehouse, and damaged ones are made again. The workspace's
    ``page_listener`` receives the numbers of packages done and in total, and then those copied. ``unknown`` are crashes
    with damaged files, which the warehouse may lack. If one of them is in the cohort, or a package cannot be made,
    ``on_problem`` is called; the other packages are copied and the release is left unfinished. A damaged file of a
    finished release is restored. ``bench`` is a definition by others to reproduce, with its crashes and date.
    ``national`` are FARS's accident tables for weighting the crashes. Raises :class:`UserError` for a malformed
    version, for a finished release of this version with other content, and for each input that differs from the
    definition's.
    """
    check_version(version)
    given = None if bench is None else _given(bench)
    warehouse, on_progress = workspace.warehouse, workspace.page_listener
    cohorts = [workspace.registry.cohort(cohort).name] if cohort else sorted(workspace.registry.cohorts())
    crashes = [row for row in query.rows(warehouse, "crashes") if cohort is None or row["cohort"] == cohort]
    missing = _bring_up_to_date(workspace, on_problem) | set(unknown)
    if cohort is not None:
        missing &= set(workspace.registry.keys(cohort))
    names, values = query.query(warehouse, _PACKED)
    rows = [dict(zip(names, row, strict=True)) for row in values]
    rows = [row for row in rows if (cohort is None or row["cohort"] == cohort) and row["key"] not in missing]
    if given is not None:
        rows = [row for row in rows if row["key"] in given["crashes"]]
        missing &= set(given["crashes"])
    folder = output / f"{NAME}-{version}"
    complete = _complete(folder)
    files = read_manifest(workspace.storage, FOLDER).files
    packages = {row["key"]: files[package_name(row["key"])] for row in rows}
    records = read_records(workspace.storage, [row["key"] for row in rows], list(Stage))
    splits = splits_of({row["key"]: (row["latitude_deg"], row["longitude_deg"]) for row in rows})
    made_on = max((records[row["key"]][Stage.VERDICT].started_at[:10] for row in rows), default="")
    if given is not None:
        made_on = given["date"]
    weighed = _weigh(rows, national)
    sums: dict[str, str] = {}
    for row in rows:
        package = packages[row["key"]]
        row["package"] = f"packages/{row['key']}.zip"
        row["split"] = splits[row["key"]].value
        row["map_attribution"] = map_attribution(records[row["key"]])
        row["package_bytes"] = package.size
        row["package_sha256"] = sums[row["package"]] = package.sha256
    bench_file = definition(rows, records, made_on, weighed)
    if given is not None and (unlike := differences(given, json.loads(bench_file))):
        raise UserError(f"{bench}: differs from the definition of this root: {'; '.join(unlike)}")
    documents = release_documents(BenchmarkRelease(version, made_on, cohorts, crashes, rows)) | {FILE: bench_file}
    sums |= {name: hashlib.sha256(data).hexdigest() for name, data in documents.items()}
    if complete and not missing and complete != sums:
        raise UserError(_other_content(folder, version, complete, sums))
    if complete and missing:
        return ReleaseReport(folder, None, len(rows), 0, len(missing))  # as it was finished
    target = Storage.open(folder, output=True)
    written = 0
    for done, row in enumerate(rows, 1):
        written += write_if_changed(target, row["package"], workspace.storage.read_whole(packages[row["key"]]))
        on_progress(done, len(rows))
    if missing:
        return ReleaseReport(folder, None, len(rows), written, len(missing))
    written += _finish(target, documents, sums)
    archived = _archive(folder, [*sums, CHECKSUMS], archive) if archive else None
    return ReleaseReport(folder, archived, len(rows), written)


def _given(bench: Path) -> dict[str, Any]:
    if not bench.is_file():
        raise UserError(f"--bench {bench}: there is no such file; a release has one as {FILE}")
    return read_definition(bench.read_bytes(), str(bench))


def _weigh(rows: Sequence[dict[str, Any]], national: Sequence[Path]) -> dict[str, Any] | None:
    """Set the weight of each crash; return a description of the weights, or None without national tables."""
    if not national:
        for row in rows:
            row["weight"] = None
        return None
    margins = national_margins(national)
    weights = rake([classes_of(row) for row in rows], margins)
    for row, weight in zip(rows, weights.tolist(), strict=True):
        row["weight"] = round(weight, 6)
    tables = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted(national)}
    return {"tables": tables, "margins": margins, "effective_crashes": round(effective_number(weights), 1)}


def _bring_up_to_date(workspace: Workspace, on_problem: OnProblem) -> set[str]:
    """Update the benchmark; return the crashes whose package or page could not be made."""
    errors = build_benchmark(workspace, contents=True).errors
    for key, error in errors.items():
        on_problem(Failure(f"{key}: no package: {last_line(error)}"))
    return set(errors)


def _complete(folder: Path) -> dict[str, str]:
    """Return the checksums of a finished release in this folder; empty without one."""
    sums = folder / CHECKSUMS
    try:
        return read_checksums(sums.read_bytes()) if sums.is_file() else {}
    except ValueError as error:
        raise UserError(
            f"{sums}: not a list of checksums ({error}); delete the folder and release this version again"
        ) from error


def _finish(target: Storage, documents: Mapping[str, bytes], sums: Mapping[str, str]) -> int:
    """Write the documents, remove packages of an earlier attempt, write the checksums; return the number written."""
    for name in target.list("packages"):
        if name not in sums:
            target.delete(name)
    written = sum(write_if_changed(target, name, data) for name, data in documents.items())
    return written + write_if_changed(target, CHECKSUMS, checksums(sums))


def _other_content(folder: Path, version: str, complete: Mapping[str, str], sums: Mapping[str, str]) -> str:
    differ = sum(complete.get(name) != sums.get(name) for name in complete.keys() | sums.keys())
    return (
        f"{folder}: version {version} was released with other content ({count_of(differ, 'file')} not the same); "
        "a version is not changed: choose another --version, or delete the folder"
    )


def _archive(folder: Path, names: Sequence[str], archive: ArchiveFormat) -> Path:
    """Return the archive beside the folder, put in its place when it is whole."""
    target = folder.with_name(f"{folder.name}.{archive}")
    handle, temporary = tempfile.mkstemp(prefix=".writing-", dir=folder.parent)
    os.close(handle)
    try:
        write_archive(folder, names, Path(temporary), archive)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(target)
    finally:
        Path(temporary).unlink(missing_ok=True)
    return target
