"""Whom a map is attributed to, and what follows for what is made of it."""

from __future__ import annotations

import pytest

from trace_dag.osm.types import OSM_ATTRIBUTION, Rights, read_attribution


@pytest.mark.parametrize(
    ("root", "attribution"),
    [
        ({}, OSM_ATTRIBUTION),
        ({"attribution": "Town of Merrow, CC0"}, "Town of Merrow, CC0"),
        ({"attribution": "Town of Merrow", "copyright": "somebody else"}, "Town of Merrow"),
        ({"copyright": "fictional, CC0"}, "fictional, CC0"),
        ({"copyright": "Town of Merrow", "license": "CC BY 4.0"}, "Town of Merrow, CC BY 4.0"),
        ({"attribution": "https://merrow.example/rights", "license": "CC0"}, "CC0"),
        ({"attribution": "https://merrow.example/rights"}, "https://merrow.example/rights"),
        (  # as the OSM API answers
            {
                "copyright": "OpenStreetMap and contributors",
                "attribution": "http://www.openstreetmap.org/copyright",
                "license": "http://opendatacommons.org/licenses/odbl/1-0/",
            },
            OSM_ATTRIBUTION,
        ),
    ],
)
def test_a_map_is_attributed_as_it_states(root: dict[str, str], attribution: str) -> None:
    assert read_attribution(root) == attribution


def test_the_licence_of_several_maps_is_that_of_all() -> None:
    assert Rights.of([OSM_ATTRIBUTION]).licence == "ODbL-1.0"
    assert Rights.of(["fictional, CC0", OSM_ATTRIBUTION, OSM_ATTRIBUTION]).licence == "CC0-1.0 AND ODbL-1.0"
    assert Rights.of(["Town of Merrow"]).licence == "NOASSERTION"


def test_only_fictional_maps_alone_make_fictional_crashes() -> None:
    assert Rights.of(["fictional, CC0"]).fictional
    assert not Rights.of(["fictional, CC0", OSM_ATTRIBUTION]).fictional
    assert not Rights.of([]).fictional
