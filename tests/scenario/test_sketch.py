"""Sketches: valid SVG, small enough to be shown in place, with the bodies where the contact is."""

from __future__ import annotations

import re

import numpy as np
import pytest
import sample_runs
from lxml import etree

import trace_dag
from trace_dag.scenario.sketch import MOST_CHARACTERS, data_url, draw_sketch


@pytest.fixture(scope="module", params=["2023-319022", "2023-319024"])
def crash(request):
    crash = trace_dag.open(sample_runs.finished())[request.param]
    return crash.road_map, crash.log


def test_fits_where_markdown_is_shown_in_place(crash):
    url = data_url(draw_sketch(*crash))
    assert len(url) <= MOST_CHARACTERS
    assert not re.search(r"[\s()<>#\"]", url), "nothing that ends an address in Markdown"


@pytest.mark.parametrize("most", [300, 500, 700])
def test_keeps_what_matters_when_there_is_less_room(crash, most):
    assert len(data_url(draw_sketch(*crash, most=most))) <= max(most, 300)


def test_bodies_are_where_they_touch(crash):
    network, log = crash
    contact = log.first_contact
    root = etree.fromstring(draw_sketch(network, log).encode())
    bodies = [element.get("d") for element in root if (element.get("d") or "").endswith("z")]
    assert len(bodies) == 2
    for path, pose in zip(bodies, (contact.pose_1, contact.pose_2), strict=True):
        corners = np.array([float(number) for number in re.findall(r"-?[\d.]+", path)]).reshape(-1, 2)
        drawn = corners.mean(axis=0) * (1, -1) + (contact.x_m, contact.y_m)
        assert drawn == pytest.approx([pose.x_m, pose.y_m], abs=0.1)


def test_a_map_without_a_simulation_can_be_sketched(crash):
    assert etree.fromstring(draw_sketch(crash[0]).encode()).tag.endswith("svg")
