"""Weights by raking, against margins by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from trace_dag.agents.evaluation.shares import effective_number
from trace_dag.warehouse.national import CrashClasses, national_margins, rake


def crash(kind: str, light: str | None) -> CrashClasses:
    return CrashClasses(kind, None, light, None)


def test_all_margins_are_the_countrys_at_once() -> None:
    crashes = [crash("parked", "dark")] * 3 + [crash("parked", "daylight")] * 2 + [crash("animal", "daylight")]
    crashes += [crash("animal", "dark")]
    margins = {"kind": {"parked": 10, "animal": 30}, "light": {"dark": 20, "daylight": 20}}
    weights = rake(crashes, margins)
    of_kind = np.array([each.kind == "parked" for each in crashes])
    of_light = np.array([each.light == "dark" for each in crashes])
    assert weights[of_kind].sum() / weights.sum() == pytest.approx(0.25)
    assert weights[of_light].sum() / weights.sum() == pytest.approx(0.5)
    assert weights.mean() == pytest.approx(1.0)
    assert 1.0 < effective_number(weights) < len(crashes)


def test_a_crash_whose_class_nobody_knows_keeps_its_weight_in_that_margin() -> None:
    weights = rake(
        [crash("parked", "dark"), crash("parked", "daylight"), crash("parked", None)],
        {"light": {"dark": 3, "daylight": 1}},
    )
    assert weights.tolist() == pytest.approx([1.5, 0.5, 1.0])


def test_a_sample_like_the_country_weighs_one_each() -> None:
    assert rake(
        [crash("parked", "dark"), crash("animal", "daylight")], {"kind": {"parked": 5, "animal": 5}}
    ).tolist() == [
        1.0,
        1.0,
    ]


def test_both_ways_in_which_tables_name_the_class_of_a_road(tmp_path: Path) -> None:
    """``FUNC_SYS`` since 2015 (3: other principal arterial), ``ROAD_FNC`` before (13: the same, urban)."""
    newer, older = tmp_path / "newer.csv", tmp_path / "older.csv"
    newer.write_text("HARM_EV,VE_FORMS,TYP_INT,LGT_COND,FUNC_SYS\n8,1,2,2,3\n73,1,1,1,7\n")
    older.write_text("HARM_EV,VE_FORMS,TYP_INT,LGT_COND,ROAD_FNC\n8,1,99,4,13\n")
    margins = national_margins([newer, older])
    assert margins["road_class"] == {"principal_arterial": 2}  # 73, an object that fell from a vehicle, is not judged
    assert margins["junction"] == {"intersection": 1}
    assert margins["light"] == {"dark": 1, "twilight": 1}
