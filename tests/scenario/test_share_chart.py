"""Bars of shares: as long as the share, with the interval of its count, and nothing that a label could break."""

from __future__ import annotations

import re
from urllib.parse import unquote

import pytest
from lxml import etree

from trace_dag.agents.evaluation.shares import Share, data_url, share_chart, wilson_interval


def test_the_interval_is_wilsons():
    # Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29
    assert wilson_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson_interval(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson_interval(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson_interval(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)
    assert wilson_interval(0, 0) == (0.0, 1.0), "nothing is known"


def test_a_bar_is_as_long_as_its_share():
    chart = etree.fromstring(
        share_chart("a < b", [Share("half & half", 5, 10), Share("all", 3, 3), Share("none", 0, 0)])
    )
    bars = chart.findall("{*}rect")[1:]
    assert float(bars[0].get("width")) * 2 == float(bars[1].get("width"))
    texts = [text.text for text in chart.findall("{*}text")]
    assert texts[:3] == ["a < b", "half & half", "5 of 10"]
    assert len(bars) == 2, "no bar where there were no cases"


def test_a_chart_is_one_address_in_markdown():
    chart = share_chart("a (b)", [Share("half & half", 5, 10), Share("another's", 3, 3)])
    address = data_url(chart)
    assert not re.search(r"[\s()<>#&\"]", address), "nothing that ends an address in Markdown or is read as an entity"
    shown = etree.fromstring(unquote(address.removeprefix("data:image/svg+xml,")))
    assert [text.text for text in shown.findall("{*}text")][-1] == "100 %"


def test_a_long_label_has_room():
    label = "a cohort with a long name, two_vehicles: another that contradicts it"
    chart = etree.fromstring(share_chart("shares", [Share(label, 1, 2)]))
    (text,) = (text for text in chart.findall("{*}text") if text.text == label)
    assert float(text.get("x")) > 6.5 * len(label), "its end, in letters of 12 px"
