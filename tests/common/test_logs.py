"""What a log line says, as text and as JSON, in this process and in those of workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import logging
from trace_dag.common.messages.logs import log_context, configure_logging, figures
configure_logging()
log = logging.getLogger("trace_dag.roads")
with log_context("2023-510179", "road_map"):
    log.warning("3 lanes are\\nnot known", extra=figures(lanes=3))
log.info("not asked for")
try:
    raise ValueError("broken")
except ValueError:
    log.exception("no picture")
"""


def lines(program: str = PROGRAM, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return done.stderr.splitlines()


def test_json_lines_name_crash_and_stage_and_carry_figures_and_tracebacks():
    first, second = map(json.loads, lines(TRACE_DAG_LOG_FORMAT="json"))
    assert (first["crash"], first["stage"], first["lanes"]) == ("2023-510179", "road_map", 3)
    assert (first["level"], first["logger"]) == ("WARNING", "trace_dag.roads")
    assert first["message"] == "3 lanes are\nnot known"
    assert "crash" not in second
    assert second["error"].endswith("ValueError: broken")


def test_text_names_the_crash_at_work_and_the_level_can_be_chosen():
    text = lines()
    assert "not known [2023-510179 road_map]" in text[1]
    assert not any("not asked for" in line for line in text)
    assert any("INFO not asked for" in line for line in lines(TRACE_DAG_LOG="info"))


@pytest.mark.parametrize("variable", ["TRACE_DAG_LOG", "TRACE_DAG_LOG_FORMAT"])
def test_impossible_requests_are_refused_with_a_reason(variable):
    done = subprocess.run(
        [sys.executable, "-m", "trace_dag.cli", "status"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {variable: "loud"},
    )
    assert done.returncode == 2
    assert done.stderr.lower().startswith(f"trace-dag: {variable}=loud".lower())
    assert done.stderr.count("\n") == 1


LIBRARIES = """
import logging, warnings
from trace_dag.cli.printing import progress_of
from trace_dag.common.messages.logs import configure_logging, print_problem
configure_logging()
logging.getLogger("alembic.runtime.migration").info("Context impl SQLiteImpl.")
logging.getLogger("trace_dag.flow").info("ours")
with progress_of("stages", 1) as tell:
    tell("2023-510179")
warnings.warn("soon gone")
print_problem("failed: 2023-510179 in road_map")
"""


def test_json_lines_are_all_that_goes_to_standard_error():
    said = [json.loads(line) for line in lines(LIBRARIES, TRACE_DAG_LOG="INFO", TRACE_DAG_LOG_FORMAT="json")]
    assert [line["logger"] for line in said] == ["trace_dag.flow", "py.warnings", "trace_dag"]
    assert said[-1]["message"] == "failed: 2023-510179 in road_map"


def test_text_logs_show_progress_and_problems_for_readers():
    said = lines(LIBRARIES, TRACE_DAG_LOG="INFO")
    assert said[-1] == "failed: 2023-510179 in road_map"
    assert any("2023-510179" in line and "1/1" in line for line in said)
    assert not any("SQLiteImpl" in line for line in said)


def test_every_outcome_of_a_run_is_a_line_with_duration_and_size(tmp_path):
    import fake_flow

    program = f"""
import sys
sys.path[:0] = [{str(fake_flow.__file__).rpartition("/")[0]!r}]
import fake_flow
from pathlib import Path
from trace_dag.common.messages.logs import configure_logging
from trace_dag.flow.batch import run_stages
from trace_dag.flow.workspace import Workspace

def main():
    configure_logging()
    workspace = Workspace.open({str(tmp_path / "root")!r}, fake_flow.FLOW, {{"execution": {{"workers": 2}}}})
    reports = {{"2023-510001": "", "2023-510002": "fail:road_map"}}
    workspace.registry.register("fakes", fake_flow.write_reports(Path({str(tmp_path / "reports")!r}), reports))
    list(run_stages(workspace, list(reports), run_id="a run"))

if __name__ == "__main__":
    main()
"""
    script = tmp_path / "run.py"
    script.write_text(program)
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"TRACE_DAG_LOG": "INFO", "TRACE_DAG_LOG_FORMAT": "json"},
    )
    said = [json.loads(line) for line in done.stderr.splitlines()]
    outcomes = {(line["crash"], line["stage"]): line for line in said if "outcome" in line}
    assert len(outcomes) == 7 + 4
    made = outcomes["2023-510001", "verdict"]
    assert made["outcome"] == "accepted"
    assert made["duration_s"] >= 0
    assert made["artefact_bytes"] > 0
    broken = outcomes["2023-510002", "road_map"]
    assert broken["outcome"] == "failed"
    assert "Traceback" in broken["traceback"]
