"""Choosing crashes: filters, samples that can be repeated, samples that fill the classes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.common.errors import UserError
from trace_dag.crash.classes import CollisionType, RoadTopology, VehicleTrajectory
from trace_dag.crash.cohorts import COVERAGE_DIMENSIONS, CohortFilter, sample, select, stratified_sample
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.listing import CrashListing


def crash(case: int, **more: object) -> CrashListing:
    return CrashListing(f"2023-{case}", 2023, case, **more)  # type: ignore[arg-type]


listings = st.lists(
    st.builds(
        crash,
        st.integers(510001, 519999),
        manner_of_collision_code=st.sampled_from([1, 2, 6, 7, 8, 99]),
        intersection_type_code=st.sampled_from([1, 2, 3, 4, 98]),
        crash_types=st.tuples(st.sampled_from([20, 50, 68, 86, 98, None])),
    ),
    unique_by=lambda listing: listing.key,
    max_size=60,
)


@pytest.mark.parametrize(
    ("wanted", "admitted"),
    [
        (CohortFilter(), True),
        (CohortFilter(states=frozenset({51}), years=frozenset({2022, 2023})), True),
        (CohortFilter(states=frozenset({4})), False),
        (CohortFilter(years=frozenset({2022})), False),
        (CohortFilter(counties=frozenset({"730"})), True),
        (CohortFilter(counties=frozenset({"petersburg"})), True),
        (CohortFilter(counties=frozenset({"73"})), False),
        (CohortFilter(cities=frozenset({"Norfolk"})), False),
        (CohortFilter(box=(37, -78, 38, -77)), True),
        (CohortFilter(box=(38, -78, 39, -77)), False),
        (CohortFilter(function_classes=frozenset({3})), True),
        (CohortFilter(function_classes=frozenset({1})), False),
        (CohortFilter(collision_types=frozenset({CollisionType.ANGLE})), True),
        (CohortFilter(topologies=frozenset({RoadTopology.T})), False),
        (CohortFilter(trajectories=frozenset({VehicleTrajectory.INTERSECTING})), True),
        (CohortFilter(min_vehicles=2, max_vehicles=2), True),
        (CohortFilter(min_vehicles=3), False),
        (CohortFilter(max_vehicles=1), False),
    ],
)
def test_filters(wanted: CohortFilter, admitted: bool) -> None:
    listing = crash(
        510179,
        latitude_deg=37.228,
        longitude_deg=-77.4,
        county_code=730,
        county_name="PETERSBURG (CITY) (730)",
        city_name="PETERSBURG",
        function_class_code=3,
        vehicles=2,
        manner_of_collision_code=6,
        intersection_type_code=2,
        crash_types=(86, 87),
    )
    assert wanted.admits(listing) is admitted


def test_a_source_without_the_fact_is_not_chosen() -> None:
    bare = crash(510001)
    assert CohortFilter().admits(bare)
    for wanted in (
        CohortFilter(box=(0, -180, 90, 0)),
        CohortFilter(min_vehicles=1),
        CohortFilter(counties=frozenset({"x"})),
    ):
        assert not wanted.admits(bare)


@pytest.mark.parametrize("box", [(38, -78, 37, -77), (37, -77, 38, -78), (37, -78, 95, -77)])
def test_boxes_the_wrong_way_round_are_one_line(box: tuple[float, float, float, float]) -> None:
    with pytest.raises(UserError, match="south, west, north, east"):
        CohortFilter(box=box)


def test_no_crash_can_have_fewer_than_more_vehicles() -> None:
    with pytest.raises(UserError, match="no crash can have both"):
        CohortFilter(min_vehicles=3, max_vehicles=2)


@given(listings, st.integers(1, 70), st.integers(0, 5), st.randoms())
def test_samples_depend_on_the_seed_and_the_crashes_alone(
    crashes: list[CrashListing], size: int, seed: int, random: object
) -> None:
    shuffled = list(crashes)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    for choose in (sample, stratified_sample):
        chosen = choose(crashes, size, seed=seed)
        assert chosen == choose(shuffled, size, seed=seed)
        assert len(chosen) == len({listing.key for listing in chosen}) == min(size, len(crashes))
        assert chosen[: size // 2 + 1] == choose(crashes, size // 2 + 1, seed=seed)[:size]


def test_other_seeds_give_other_samples() -> None:
    crashes = [crash(510000 + number) for number in range(1, 500)]
    chosen = {tuple(listing.key for listing in sample(crashes, 20, seed=seed)) for seed in range(20)}
    assert len(chosen) == 20


def test_every_crash_is_as_likely_as_another() -> None:
    crashes = [crash(510000 + number) for number in range(1, 21)]
    counts = Counter(listing.key for seed in range(2000) for listing in sample(crashes, 5, seed=seed))
    assert len(counts) == 20
    assert all(400 < count < 600 for count in counts.values())  # expected 500, standard deviation 19


@given(listings, st.integers(0, 5))
def test_stratified_samples_cover_every_class_there_is_soon(crashes: list[CrashListing], seed: int) -> None:
    """Each choice adds at least one class until all are covered, so as many choices as classes suffice."""
    classes = {(each, getattr(listing, each)) for listing in crashes for each in COVERAGE_DIMENSIONS}
    chosen = stratified_sample(crashes, max(1, len(classes)), seed=seed)
    assert {(each, getattr(listing, each)) for listing in chosen for each in COVERAGE_DIMENSIONS} == classes


def test_stratified_samples_are_more_even_than_random_ones(shared_data: Path) -> None:
    folder = shared_data / "fars-csv"
    if not folder.is_dir():
        pytest.skip(f"FARS CSV files not present at {folder}")
    two = select(FarsCsvSource.open(folder).listings(), CohortFilter(min_vehicles=2, max_vehicles=2))

    def unevenness(chosen: list[CrashListing]) -> float:
        counts = Counter((each, getattr(listing, each)) for each in COVERAGE_DIMENSIONS for listing in chosen)
        return sum(count**2 for count in counts.values())

    stratified = unevenness(stratified_sample(two, 25, seed=1))
    assert all(stratified < unevenness(sample(two, 25, seed=seed)) for seed in range(10))


def test_selections_are_in_order_of_keys() -> None:
    crashes = [crash(case) for case in (510003, 510001, 510002)]
    assert [listing.state_case for listing in select(crashes, CohortFilter())] == [510001, 510002, 510003]


@pytest.mark.parametrize("size", [0, -1])
def test_samples_of_nothing_are_refused(size: int) -> None:
    with pytest.raises(UserError):
        sample([], size, seed=1)
