"""American street names as police and OpenStreetMap write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.roads.crash_site.street_names import SAME_STREET, RouteSystem, parse_street, similarity

SAME = [
    ("SR-41/FRANKLIN TRNPK", "Franklin Turnpike"),
    ("SR-41/FRANKLIN TRNPK", "VA 41"),
    ("US-301", "US 301"),
    ("US-301", "US 1;US 301"),
    ("I-85", "Interstate 85"),
    ("I-95 NB", "I 95"),
    ("MU-8669 PRINCESS ANNE RD", "Princess Anne Road"),
    ("SR-101", "AZ 101 Loop"),
    ("RT-175", "VA 175"),
    ("CR-125 CLIME RD.", "Clime Road"),
    ("CR-ROSS ROAD", "Ross Road"),
    ("BIA-1 CASA BLANCA RD", "BIA 1"),
    ("I-283 INTERSTATE 283 RD", "I 283"),
    ("ST CLAIR AVE", "Saint Clair Avenue"),
    ("E 5TH AVE", "East Fifth Avenue"),
    ("41ST ST W", "West 41st Street"),
    ("AVENUE 8 1/2 E", "South Avenue 8½ E"),
    ("COUNTY 14TH ST", "West County 14th Street"),
    ("AVENUE G", "South Avenue G"),
    ("NORTH ST", "North Street"),
    ("AVENUE E", "Avenue E"),
    ("COLONIAL TRAIL W", "Colonial Trail West"),
    ("R H JOHNSON BLVD", "R.H. Johnson Boulevard"),
    ("MLK JR BLVD", "Martin Luther King Boulevard"),
    ("N OAKWOOD DR", "Oak Wood Drive"),
    ("COUNTY ROAD 12", "CR 12"),
    ("STATE ROUTE 9119", "SR 9119"),
    ("US HIGHWAY 60", "US 60"),
    ("KENTUK CHURCH RD", "Kentuck Church Road"),
]
OTHER = [
    ("US-301", "US 31"),
    ("US-60", "AZ 60"),
    ("I-8", "I 85"),
    ("13TH ST", "3rd Street"),
    ("4TH AVE", "South 14th Avenue"),
    ("K ST", "J Street"),
    ("OAK ST", "Elm Street"),
    ("LOVERS LN", "Windsor Boulevard"),
    ("AVENUE G", "Avenue E"),
    ("NORTH ST", "South Street"),
]


@pytest.mark.parametrize(("reported", "mapped"), SAME)
def test_names_of_one_street_are_found_alike(reported: str, mapped: str) -> None:
    value = similarity(reported, [mapped])
    assert value is not None
    assert value >= SAME_STREET


@pytest.mark.parametrize(("reported", "mapped"), OTHER)
def test_names_of_two_streets_are_distinguished(reported: str, mapped: str) -> None:
    value = similarity(reported, [mapped])
    assert value is not None
    assert value < 0.4


@pytest.mark.parametrize(
    ("reported", "better", "worse"),
    [
        ("SOUTH MERRIMAC RD", "South Merrimac Road", "North Merrimac Road"),
        ("I-8", "I 8", "I 8 BUS"),
        ("CR-726", "CR 726", "SR 726"),
        ("FRANKLIN ST", "Franklin Street", "Franklin Avenue"),
        ("GEORGE WASHINGTON MEMORIAL HWY", "George Washington Memorial Highway", "George Washington Highway"),
    ],
)
def test_the_better_match_scores_higher(reported: str, better: str, worse: str) -> None:
    good, bad = similarity(reported, [better]), similarity(reported, [worse])
    assert good is not None
    assert bad is not None
    assert good > bad > 0


@pytest.mark.parametrize(
    ("reported", "mapped"),
    [("US-301", ["Hanover Courthouse Road"]), ("FRONTAGE RD", ["I 85"]), ("", ["Main Street"]), ("MAIN ST", [])],
)
def test_a_number_and_a_name_say_nothing_of_each_other(reported: str, mapped: list[str]) -> None:
    assert similarity(reported, mapped) is None


@pytest.mark.parametrize("text", ["UNNAMED", "UNKNOWN ROAD", "PRIVATE DR", "", "  ", "/", "I-10 RAMP"])
def test_words_that_name_no_street_are_no_name(text: str) -> None:
    assert parse_street(text).names == ()


@pytest.mark.parametrize(
    ("reported", "mapped", "alike"),
    [
        ("4300 WISCONSIN AVE NW", "Wisconsin Avenue Northwest", True),
        ("4300 BLK OF WISCONSIN AVE NW", "Wisconsin Avenue Northwest", True),
        ("1200 N MAIN ST", "North Main Street", True),
        ("142 STREET", "142nd Street", True),
        ("12 MILE RD", "Mile Road", False),
        ("42 ST", "43rd Street", False),
    ],
)
def test_the_number_of_a_house_or_block_is_no_part_of_a_name(reported: str, mapped: str, alike: bool) -> None:
    assert (similarity(reported, [mapped]) >= SAME_STREET) is alike


def test_ramps_are_seen_as_such() -> None:
    ramp = parse_street("SR-303 RAMP")
    assert ramp.ramp
    assert [(route.system, route.number) for route in ramp.routes] == [(RouteSystem.STATE, "303")]
    assert not parse_street("RAMPART ST").ramp


@given(st.text(max_size=40), st.lists(st.text(max_size=40), max_size=3))
def test_any_texts_compare(reported: str, mapped: list[str]) -> None:
    value = similarity(reported, mapped)
    assert value is None or 0.0 <= value <= 1.0


WORDS = st.lists(
    st.sampled_from(["Oak", "Maple", "Church", "King", "Mill", "Old"]), min_size=1, max_size=3, unique=True
)


@given(WORDS, st.sampled_from([("Street", "ST"), ("Road", "RD"), ("Avenue", "AVE"), ("Turnpike", "TPKE")]))
def test_abbreviation_and_case_do_not_matter(words: list[str], kind: tuple[str, str]) -> None:
    written = " ".join([*words, kind[0]])
    abbreviated = " ".join([*words, kind[1]]).upper()
    assert similarity(abbreviated, [written]) == 1.0
    assert similarity(written, [abbreviated]) == 1.0


@pytest.mark.parametrize(
    ("reported", "mapped"),
    [("CR-128TH AVE", "North 128th Avenue"), ("SR-63S", "IN 63"), ("CR-8TH ST", "West 8th Street"), ("I-35W", "I 35W")],
)
def test_systems_without_a_number_and_directions_after_one_are_no_part_of_a_name(reported: str, mapped: str) -> None:
    assert similarity(reported, [mapped]) >= SAME_STREET
