"""What a benchmark says of itself: ratios, goals, and the page over versions."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import pytest

import benchmarks
from benchmarks.measuring import Figure, medians
from benchmarks.results import append, page


@pytest.mark.parametrize(
    ("figure", "reached"),
    [
        (Figure("time", 0.5, "s", goal=1.0), True),
        (Figure("time", 1.5, "s", goal=1.0), False),
        (Figure("rate", 150.0, "1/min", goal=200.0, at_least=True), False),
        (Figure("two", 180.0, "1/min", "one", 100.0, 1.7, at_least=True, goal_of_ratio=True), True),
        (Figure("no goal", 1.0, "s"), None),
    ],
)
def test_goals(figure, reached):
    assert figure.reached is reached


def test_every_benchmark_can_be_loaded():
    """No test runs them: one that asks for what the program no longer has would be found when it is needed."""
    names = [file.stem for file in Path(benchmarks.__file__).parent.glob("*.py") if file.stem != "__main__"]
    assert "throughput" in names
    for name in names:
        import_module(f"benchmarks.{name}")


def test_work_and_its_peer_take_turns():
    done, moments = [], iter(range(100))
    both = medians(3, lambda: done.append("ours"), lambda: done.append("peer"), clock=lambda: float(next(moments)))
    assert done == ["ours", "peer"] * 3
    assert both == [1.0, 1.0]


def test_figures_are_kept_and_the_page_shows_what_misses_its_goal(tmp_path):
    file = tmp_path / "results.json"
    append([Figure("slow", 2.0, "s", "a peer", 1.0, goal=1.0)], file)
    kept = append([Figure("quick", 0.5, "s", goal=1.0)], file)
    assert json.loads(file.read_text()) == kept
    assert len(kept) == 1, "of one version on one machine"
    earlier = {"version": "0.0", "machine": "", "measured_at": "then", "figures": dict(kept[0]["figures"])}
    later = {**earlier, "version": "0.1", "figures": {"quick": {**kept[0]["figures"]["quick"], "value": 5123.0}}}
    text = page([earlier, later])
    assert "| slow | s | a peer | ≤ 1 | **2 (2)** | 0.0 |" in text
    assert "| quick | s |  | ≤ 1 | 5,123 | 0.1 |" in text


def test_calibration_is_one_table_with_chance_and_the_models_that_were_asked(tmp_path):
    file = tmp_path / "results.json"
    append([Figure("quick", 0.5, "s")], file)
    append([Figure("area", 88.0, "%", "by chance", 45.0, hidden=155, note="within an hour")], file)
    text = page(append([Figure("lane", 90.0, "%", "by chance", 81.0, hidden=7)], file))
    table = text.partition("## Calibration")[2]
    assert "| hidden | number | recovered | by chance | published model's kind | measured with |" in table
    assert "| area | 155 | 88 % | 45 % | - |" in table
    assert "None was, here." in table
    assert "- area: within an hour" in table
    assert "area" not in text.partition("## Calibration")[0]
    asked = page(append([Figure("lane", 90.0, "%", "by chance", 81.0, hidden=7, asked={"llm:x": 41.0})], file))
    assert "| hidden | number | recovered | by chance | llm:x | measured with |" in asked
    assert "| lane | 7 | 90 % | 81 % | 41 % |" in asked
    assert "| area | 155 | 88 % | 45 % |  |" in asked
