"""What a stage function is given of the stages before it."""

from __future__ import annotations

import pytest

from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.artefacts import Artefact
from trace_dag.flow.cohorts.registry import CrashSource, ReportSource
from trace_dag.flow.contract import CrashFiles, DamagedArtefactError

MAP: Artefact[str] = Artefact(Stage.ROAD_MAP, ("xodr",), f"{__name__}:as_text")
NAME = "road_map/2023-1.xodr"


def as_text(data: bytes) -> str:
    return data.decode()


@pytest.fixture
def storage(tmp_path) -> Storage:
    return Storage(str(tmp_path))


@pytest.fixture
def crash(storage) -> CrashFiles:
    return CrashFiles("2023-1", CrashSource("cohort", ReportSource("file", "report.xml")), Settings(), storage)


def made(storage: Storage, content: bytes) -> OutcomeRecord:
    file = storage.write(NAME, content)
    provenance = Provenance(code="", inputs={}, settings={})
    return OutcomeRecord(
        "2023-1", Stage.ROAD_MAP, Outcome.ACCEPTED, provenance, "", "run", "2026-01-01", artefacts=(file,)
    )


def test_a_file_read_back_by_its_stage_is_not_read_again(crash, storage):
    crash.accept(made(storage, b"map"), {NAME: b"map"}, {NAME: "as read back"})
    assert crash.load(MAP) == "as read back"


def test_a_stage_made_again_is_read_anew(crash, storage):
    crash.accept(made(storage, b"map"), {NAME: b"map"}, {NAME: "as read back"})
    crash.accept(made(storage, b"another map"))
    assert crash.load(MAP) == "another map"


def test_a_file_that_an_earlier_version_did_not_make_is_named_with_its_remedy(crash, storage):
    crash.accept(made(storage, b"map"))
    with pytest.raises(DamagedArtefactError, match=r"another version.*trace-dag run --only 2023-1 --from road_map"):
        crash.read(Stage.ROAD_MAP, "other")
