"""Fingerprints and outcome records."""

from __future__ import annotations

from dataclasses import replace

import pytest

from trace_dag import provenance
from trace_dag.errors import Failure, Reason, Stage
from trace_dag.pipeline.stages import FLOW
from trace_dag.provenance import (
    Outcome,
    OutcomeRecord,
    Provenance,
    code_version,
    record_from_json,
    record_to_json,
    settings_of,
)
from trace_dag.settings import SimSettings
from trace_dag.storage import StoredFile

MADE_OF = Provenance("0.1.0+abc", {"step_s": 0.005}, {"road_map.xodr": "12ab"})
RECORD = OutcomeRecord(
    key="2023-510179",
    stage=Stage.ROAD_MAP,
    outcome=Outcome.REJECTED,
    provenance=MADE_OF,
    fingerprint=MADE_OF.fingerprint,
    run_id="r1",
    started_at="2026-01-01T00:00:00.000+00:00",
    duration_s=0.25,
    reason=Reason.CRASH_OFF_ROAD,
    detail="The nearest road is 31 m away.",
    measured=31.0,
    threshold=30.0,
    artefacts=(StoredFile("road_map/2023-510179.json", 10, "ff"),),
    figures={"roads": 3, "converter": "native"},
)


def test_record_survives_storage():
    assert record_from_json(record_to_json(RECORD), name=RECORD.name) == RECORD


def test_half_a_record_is_said_to_be_none():
    with pytest.raises(Failure, match=r"road_map/x\.outcome\.json: not an outcome record"):
        record_from_json(record_to_json(RECORD)[:40], name="road_map/x.outcome.json")


@pytest.mark.parametrize(
    "other",
    [
        replace(MADE_OF, code="0.1.0+abd"),
        replace(MADE_OF, settings={"step_s": 0.004}),
        replace(MADE_OF, inputs={"road_map.xodr": "12ac"}),
        replace(MADE_OF, inputs={"road_map.json": "12ab"}),
    ],
)
def test_fingerprint_changes_with_every_part(other):
    assert other.fingerprint != MADE_OF.fingerprint


def test_fingerprint_does_not_depend_on_order():
    one = replace(MADE_OF, inputs={"a": "1", "b": "2"})
    assert one.fingerprint == replace(MADE_OF, inputs={"b": "2", "a": "1"}).fingerprint


def test_fields_that_say_how_a_service_is_reached_are_no_part_of_it():
    assert settings_of(SimSettings(carla_port=2002)) == settings_of(SimSettings())
    assert settings_of(SimSettings(friction=0.5)) != settings_of(SimSettings())


def test_history_keeps_the_latest_twenty_finished_outcomes():
    record = RECORD
    for number in range(30):
        started = replace(RECORD, outcome=Outcome.STARTED, artefacts=()).superseding(record)
        record = replace(RECORD, run_id=f"r{number + 2}").superseding(started)
    assert [past.run_id for past in record.history] == [f"r{number}" for number in range(11, 31)]


def imports_below(module: str) -> set[str]:
    return set(provenance._import_closure((module,)))


def test_code_version_follows_imports_inside_functions_and_leaves_the_runner_out():
    closure = imports_below("trace_dag.sim.run")
    assert {"trace_dag.sim.run", "trace_dag.sim.types", "trace_dag.states.types", "trace_dag.geometry"} <= closure
    assert not any(name.startswith(("trace_dag.pipeline", "trace_dag.storage")) for name in closure)


def test_code_version_changes_with_the_source_of_what_is_imported(tmp_path, monkeypatch):
    package = tmp_path / "trace_dag"
    (package / "crash").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "crash/__init__.py").write_text("")
    (package / "crash/parse.py").write_text("def read():\n    from trace_dag.crash import codes\n")
    (package / "crash/codes.py").write_text("A = 1\n")
    (package / "crash/unrelated.py").write_text("B = 1\n")
    (package / "crash/table.csv").write_text("1\n")
    monkeypatch.setattr(provenance, "_PACKAGE", package)

    def version() -> str:
        for cached in (code_version, provenance._import_closure, provenance._imports_of):
            cached.cache_clear()
        return code_version(("trace_dag.crash.parse",))

    try:
        first = version()
        (package / "crash/unrelated.py").write_text("B = 2\n")
        assert version() == first
        (package / "crash/codes.py").write_text("A = 2\n")
        second = version()
        assert second != first
        (package / "crash/table.csv").write_text("2\n")
        assert version() != second
    finally:
        monkeypatch.undo()
        version()


@pytest.mark.parametrize("definition", FLOW.stages, ids=lambda definition: definition.stage)
def test_every_package_a_stage_function_imports_is_in_its_code_version(definition):
    """What the functions import by hand must not go missing from the list of code they depend on."""
    import ast
    import inspect

    from trace_dag.pipeline import stages

    covered = set(provenance._import_closure(definition.code))
    readers = {
        "record_of": stages.record_of,
        "extract_of": stages.extract_of,
        "network_of": stages.network_of,
        "estimate_of": stages.estimate_of,
        "logs_of": stages.logs_of,
        "backend": stages.backend.__wrapped__,
        "map_catalog": stages.map_catalog.__wrapped__,
        "_ask_map_service": stages._ask_map_service,
    }
    waiting, seen = [definition.function or definition.batch_function], set()
    while waiting:
        tree = ast.parse(inspect.getsource(waiting.pop()))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("trace_dag"):
                if node.module.startswith(provenance._NOT_PART_OF_ANY_RESULT):
                    continue
                assert node.module in covered, f"{definition.stage} imports {node.module}"
            elif isinstance(node, ast.Name) and node.id in readers and node.id not in seen:
                seen.add(node.id)
                waiting.append(readers[node.id])


def test_inputs_of_every_stage_are_what_its_function_reads():
    """A stage that reads an artefact it does not declare would not notice when that artefact changes."""
    import ast
    import inspect

    from trace_dag.pipeline import stages

    reads = {
        "record_of": {(Stage.CRASH_RECORD, "parquet")},
        "extract_of": {(Stage.OSM_EXTRACT, "osm")},
        "network_of": {(Stage.ROAD_MAP, "xodr")},
        "map_report_of": {(Stage.ROAD_MAP, "json")},
        "estimate_of": {(Stage.STATE_ESTIMATE, "json")},
        "logs_of": {(Stage.SIMULATION_LOG, "parquet"), (Stage.SIMULATION_LOG, "json")},
    }
    for definition in stages.FLOW.stages:
        tree = ast.parse(inspect.getsource(definition.function or definition.batch_function))
        used = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in reads:
                used |= reads[node.id]
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "read":
                stage, extension = node.args[0], node.args[1] if len(node.args) > 1 else None
                if isinstance(stage, ast.Attribute) and isinstance(extension, ast.Constant):
                    used.add((Stage[stage.attr], extension.value))
        assert used <= set(definition.inputs), definition.stage
