"""A large map file is read once for all crashes that need it, however few a run takes at a time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import osmium
import pytest
from sample_runs import KEYS, SAMPLE, reports_of

from trace_dag.cohorts.ingest import ingest
from trace_dag.cohorts.kept_maps import remove_unused_of_maps
from trace_dag.flow import large_maps
from trace_dag.flow.batch import run_stages
from trace_dag.flow.records import read_records
from trace_dag.flow.verify import DisagreementKind, verify_storage
from trace_dag.flow.workspace import Workspace
from trace_dag.osm import extraction
from trace_dag.osm.large_map import FOLDER
from trace_dag.provenance import Outcome
from trace_dag.stage import Stage

UP_TO_EXTRACT = (Stage.RAW_REPORT, Stage.CRASH_RECORD, Stage.OSM_EXTRACT)


@pytest.fixture
def cohort(tmp_path: Path) -> Callable[[str], Workspace]:
    """A root with some crashes of the sample and its towns as sorted ``.osm.pbf``."""
    towns = []
    for town, box in (("merrow", (-101.57, 41.82, -101.51, 41.85)), ("quill", (-101.33, 41.76, -101.30, 41.78))):
        header = osmium.io.Header()
        header.set("sorting", "Type_then_ID")
        header.add_box(osmium.osm.Box(*box))
        towns.append(tmp_path / f"{town}.osm.pbf")
        with osmium.SimpleWriter(str(towns[-1]), header=header) as writer:
            osmium.apply(str(SAMPLE / "osm" / f"{town}.osm"), writer)
    reports = reports_of(tmp_path / "reports")

    def make(name: str) -> Workspace:
        workspace = Workspace.open(str(tmp_path / name), overrides={"execution": {"executor": "in_process"}})
        ingest(workspace.storage, "sample", reports=[reports], maps=towns)
        return workspace

    return make


def run(workspace: Workspace, keys: tuple[str, ...] = KEYS, **options: object) -> None:
    for _ in run_stages(workspace, keys, UP_TO_EXTRACT, run_id="test", **options):  # type: ignore[arg-type]
        pass


def extracts(workspace: Workspace) -> dict[str, tuple[object, ...]]:
    """What the stage says of each crash, and the digests of what it stored."""
    records = read_records(workspace.storage, KEYS, [Stage.OSM_EXTRACT])
    return {
        key: (record.outcome, record.detail, [file.sha256 for file in record.artefacts])
        for key, of_crash in records.items()
        for record in of_crash.values()
    }


@pytest.fixture
def passes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Every file is a large one; the numbers of sites of each pass over one."""
    done: list[int] = []
    divide = large_maps.divide

    def counted(large: object, sites: tuple[object, ...], **options: object) -> bool:
        done.append(len(sites))
        return divide(large, sites, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(large_maps, "divide", counted)
    monkeypatch.setattr("trace_dag.osm.catalog.divide", counted)
    return done


def test_one_pass_for_all_batches_and_the_same_extracts(
    cohort: Callable[[str], Workspace], passes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = cohort("plain")
    run(plain)
    assert passes == []
    monkeypatch.setattr(extraction, "_LARGE", 0)
    large = cohort("large")
    for start in range(0, len(KEYS), 3):
        run(large, KEYS[start : start + 3])
    assert len(passes) <= 2  # one for each file
    assert extracts(large) == extracts(plain)
    assert sum(outcome is Outcome.ACCEPTED for outcome, *_ in extracts(large).values()) >= 5
    assert [name for name in large.storage.list(FOLDER) if name.endswith(".piece")] == []
    run(large, force=[Stage.OSM_EXTRACT])
    assert extracts(large) == extracts(plain)
    assert len(passes) <= 4


def test_what_no_registered_map_needs_is_named_and_taken_away(
    cohort: Callable[[str], Workspace], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extraction, "_LARGE", 0)
    workspace = cohort("root")
    run(workspace)
    kept = list(workspace.storage.list(FOLDER))
    assert len(kept) == 1  # the first look at the file that covers them
    assert verify_storage(workspace.storage, workspace.local_folder).disagreements == ()
    workspace.registry.drop_maps(["merrow.osm.pbf", "quill.osm.pbf"])
    found = verify_storage(workspace.storage, workspace.local_folder).disagreements
    assert [each.file for each in found if each.kind is DisagreementKind.UNLISTED_FILE] == kept
    remove_unused_of_maps(workspace.storage)
    assert not workspace.storage.list(FOLDER)
