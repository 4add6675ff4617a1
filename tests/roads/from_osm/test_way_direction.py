"""One-way traffic goes along its way, whatever the tags; reversible roads go one way at a time."""

from __future__ import annotations

from datetime import datetime

import pytest

from trace_dag.osm.types import BoundingBox, OsmExtract, OsmWay
from trace_dag.roads.from_osm.way_direction import REVERSIBLE_TAG, TURNED_TAG, along_traffic


def along(when: datetime | None = None, **tags: str) -> OsmWay:
    """A primary road from node 1 to node 2, along its traffic; ``__`` in a key stands for a colon."""
    named = {key.replace("__", ":"): value for key, value in tags.items()}
    way = OsmWay(7, (1, 2), {"highway": "primary", **named})
    return along_traffic(OsmExtract(BoundingBox(0.0, 0.0, 1.0, 1.0), {}, (way,)), when).ways[0]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"parking__right": "lane"}, {"parking:left": "lane"}),
        ({"sidewalk": "left"}, {"sidewalk": "right"}),
        ({"sidewalk": "both"}, {"sidewalk": "both"}),
        ({"cycleway__left__width": "2"}, {"cycleway:right:width": "2"}),
        ({"lanes__backward": "3"}, {"lanes:forward": "3"}),
        ({"maxspeed__backward": "45 mph"}, {"maxspeed:forward": "45 mph"}),
        # A list of a direction goes from left to right as its drivers see it, one without along the way.
        ({"turn__lanes__backward": "left|through"}, {"turn:lanes:forward": "left|through"}),
        ({"width__lanes": "3|4"}, {"width:lanes": "4|3"}),
        ({"turn__lanes": "right|through|left"}, {"turn:lanes": "left|through|right"}),
        ({"turn__lanes": "left|through|right"}, {"turn:lanes": "left|through|right"}),  # written as drivers see it
        ({"incline": "5%"}, {"incline": "-5%"}),
        ({"incline": "down"}, {"incline": "up"}),
    ],
)
def test_a_way_against_its_traffic_is_turned_round(before: dict[str, str], after: dict[str, str]) -> None:
    way = along(oneway="-1", **before)
    assert way.node_ids == (2, 1)
    assert way.tags == {"highway": "primary", "oneway": "yes", TURNED_TAG: "yes", **after}


def test_other_ways_stay_as_they_are() -> None:
    for tags in ({}, {"oneway": "yes"}, {"oneway": "no"}, {"oneway": "maybe"}):
        assert along(**tags) == OsmWay(7, (1, 2), {"highway": "primary", **tags})


_HOURS = "yes @ (05:00-12:00); -1 @ (12:00-05:00)"
_RUSH = "yes @ (Mo-Fr 06:00-09:00); -1 @ (Mo-Fr 15:00-18:00)"


@pytest.mark.parametrize(
    ("conditional", "when", "nodes", "said"),
    [
        (_HOURS, datetime(2023, 5, 3, 7, 30), (1, 2), "by the hour"),
        (_HOURS, datetime(2023, 5, 3, 14, 0), (2, 1), "by the hour"),
        (_HOURS, datetime(2023, 5, 3, 3, 0), (2, 1), "by the hour"),  # from noon to the next morning
        (_HOURS, None, (1, 2), "unknown"),
        (_RUSH, datetime(2023, 5, 3, 16, 0), (2, 1), "by the hour"),  # a Wednesday
        (_RUSH, datetime(2023, 5, 6, 16, 0), (1, 2), "unknown"),  # a Saturday
        ("-1 @ (when the gate says so)", datetime(2023, 5, 3, 7, 30), (1, 2), "unknown"),
        ("", datetime(2023, 5, 3, 7, 30), (1, 2), "unknown"),
    ],
)
@pytest.mark.parametrize("oneway", ["reversible", "alternating"])
def test_the_hour_decides_which_way_a_reversible_road_went(
    oneway: str, conditional: str, when: datetime | None, nodes: tuple[int, int], said: str
) -> None:
    way = along(when, oneway=oneway, oneway__conditional=conditional)
    assert way.node_ids == nodes
    assert (way.tags["oneway"], way.tags[REVERSIBLE_TAG]) == ("yes", said)
