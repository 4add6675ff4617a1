"""Public crash tables, each from fictional files in its layout to verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from sample_runs import SAMPLE, trace_dag

from trace_dag.crash.registers.mapping import list_shipped_mappings, read_mapping

REGISTERS = Path(__file__).resolve().parents[1] / "registers"
LAYOUTS = sorted(folder.name for folder in REGISTERS.iterdir() if folder.is_dir())
UNSAID = {
    "cris-19000001": "P_CRASH1 unknown",  # which of the two turned, or whether they went straight
    "cris-19000003": "P_CRASH1 unknown",
    "penndot-2022990003": "where person 2 was",
    "maryland-NW3": "where person 2 was",
}
"""Facts that a table cannot tell, by the crash that is rejected for it."""


def test_every_layout_comes_to_its_verdicts(tmp_path):
    root = tmp_path / "root"
    for name in LAYOUTS:
        words = ("ingest", "--register", name, str(REGISTERS / name), "--maps", str(SAMPLE / "osm"))
        checked = trace_dag(root, *words, "--check").stdout
        assert "3 crashes in 6 rows" in checked
        assert "left out" not in checked
        assert "not mapped, so not known" not in checked
        assert trace_dag(root, *words).returncode == 0
    assert trace_dag(root, "run").returncode == 0
    query = "SELECT key, final_state, reason, detail FROM judged_crashes"
    rows = {row["key"]: row for row in json.loads(trace_dag(root, "sql", "--format", "json", query).stdout)}
    assert len(rows) == 3 * len(LAYOUTS)
    rejected = {key for key, row in rows.items() if row["final_state"] == "rejected"}
    assert rejected == UNSAID.keys()
    for key, said in UNSAID.items():
        assert rows[key]["reason"] == "incomplete_trajectory"
        assert said in rows[key]["detail"]
    assert {row["final_state"] for key, row in rows.items() if key not in UNSAID} <= {"verified", "first_event_only"}


@pytest.mark.parametrize("name", list_shipped_mappings())
def test_a_shipped_mapping_names_what_it_was_made_from_and_what_its_table_lacks(name):
    mapping = read_mapping(name)
    assert mapping.documented
    assert mapping.lacks_in_words
    assert name in LAYOUTS or name in ("tempe", "montgomery")
