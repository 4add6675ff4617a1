"""Thumbnails that move: where the bodies are when, and how small they stay."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sample_runs
from lxml import etree

import trace_dag
from trace_dag.pages.picture_motion import draw_thumbnail


@pytest.fixture(scope="module", params=["2023-319022", "2023-319024"])
def crash(request):
    crash = trace_dag.open(sample_runs.finished())[request.param]
    return crash.road_map, crash.log


def values(group, kind):
    (moved,) = (each for each in group.findall("{*}animateTransform") if each.get("type") == kind)
    return moved.get("values").split(";")


def test_bodies_are_drawn_where_the_log_has_them(crash):
    network, log = crash
    drawn = etree.fromstring(draw_thumbnail(network, log))
    groups = [group for group in drawn.iter("{*}g") if group.find("{*}animateTransform") is not None]
    assert len(groups) == len(log.vehicles)
    contact = log.first_contact
    drawn_at, meant = [], []
    for group, pose, number in zip(
        groups, (contact.pose_1, contact.pose_2), (contact.number_1, contact.number_2), strict=True
    ):
        east, south = map(float, values(group, "translate")[12].split(","))  # 1.2 s after the beginning
        drawn_at.append((east / 100, -south / 100))
        meant.append(pose.xy_m)
        body, box = log.bodies[number], group.find("{*}rect")
        assert float(box.get("width")) / 100 == pytest.approx(body.length_m, abs=0.01)
    apart = [[second - first for first, second in zip(*each, strict=True)] for each in (drawn_at, meant)]
    assert apart[0] == pytest.approx(apart[1], abs=0.3), "from the one body to the other"


def test_stays_small(crash):
    assert len(draw_thumbnail(*crash)) < 40_000


def test_without_a_contact_there_is_nothing_to_show(crash):
    network, log = crash
    with pytest.raises(ValueError, match="without a contact"):
        draw_thumbnail(network, replace(log, contacts=()))
