"""The stored crash record: declared once, round trips, readable by others."""

from __future__ import annotations

import dataclasses
import typing
from pathlib import Path

import duckdb
import pandas as pd
import pytest
from crash_reports import report
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from trace_dag.common.errors import Failure
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, NonMotorist, VehicleRecord
from trace_dag.crash.tables import CRASH_RECORD, SCHEMA_VERSION, record_from_parquet, record_to_parquet

DERIVED = {CrashRecord: ["kind", "severity", "schema_version"], EventRecord: ["kind"], NonMotorist: ["party", "kind"]}
"""Columns that follow from others, for those who read the table alone."""
finite = st.floats(allow_nan=False, allow_infinity=False)
int32 = st.integers(-(2**31), 2**31 - 1)
areas = st.builds(ImpactArea, code=int32, clock_h=finite, centre_rad=finite, half_width_rad=finite)
text = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


def _strategy(kind: object) -> st.SearchStrategy[object]:
    """Any value a field of that type can hold in storage."""
    args = typing.get_args(kind)
    if typing.get_origin(kind) is typing.Annotated:
        low, high = args[1].metadata
        return (st.integers if args[0] is int else st.floats)(low.ge, high.le)
    if typing.get_origin(kind) is tuple:
        return st.lists(_strategy(args[0]), max_size=3).map(tuple)
    if args:
        return st.one_of([st.none() if arg is type(None) else _strategy(arg) for arg in args])
    if dataclasses.is_dataclass(kind):
        return _instances(kind)  # type: ignore[arg-type]
    plain = {int: int32, float: finite, str: text, bool: st.booleans()}
    return plain[kind] if kind in plain else st.sampled_from(list(kind))  # type: ignore[index, call-overload]


def _instances(kind: type) -> st.SearchStrategy[object]:
    hints = typing.get_type_hints(kind, include_extras=True)
    fields = {field.name: _strategy(hints[field.name]) for field in dataclasses.fields(kind)}
    if kind is NonMotorist:
        fields["number"] = st.integers(0, 999)
    return st.builds(kind, **fields)


@hypothesis_settings(max_examples=30, suppress_health_check=list(HealthCheck))
@given(_instances(CrashRecord))
def test_any_record_comes_back_as_it_was(record: CrashRecord) -> None:
    assert record_from_parquet(record_to_parquet(record)) == record


def test_real_records_come_back_as_they_were(real_reports: dict[str, bytes]) -> None:
    settings = CrashSettings(repair_malformed=True)
    for name, data in real_reports.items():
        record = read_report(data, name=name, settings=settings)
        assert record_from_parquet(record_to_parquet(record)) == record


@pytest.mark.parametrize(
    ("kind", "path"),
    [(CrashRecord, ""), (VehicleRecord, "vehicles."), (EventRecord, "events."), (NonMotorist, "non_motorists."),
     (ImpactArea, "vehicles.impact.")],
)  # fmt: skip
def test_every_field_is_declared_once(kind: type, path: str) -> None:
    declared = [row["column"] for row in CRASH_RECORD.dictionary()]
    names = [column.removeprefix(path) for column in declared if column.startswith(path)]
    fields = [field.name for field in dataclasses.fields(kind)]
    assert [name for name in names if "." not in name] == fields + DERIVED.get(kind, [])


def test_units_are_in_the_names_and_every_column_has_a_meaning() -> None:
    suffixes = {"m": "_m", "m/s": "_mps", "rad": "_rad", "deg": "_deg", "kg": "_kg"}
    for row in CRASH_RECORD.dictionary():
        assert row["meaning"], row
        if row["unit"] in suffixes:
            assert row["column"].endswith(suffixes[row["unit"]]), row


def test_others_can_read_it(settings: CrashSettings, tmp_path: Path) -> None:
    for number, vehicles in enumerate([None, [{}]]):
        record = read_report(report(vehicles=vehicles), name="report.xml", settings=settings)
        (tmp_path / f"{number}.parquet").write_bytes(record_to_parquet(record))
        (tmp_path / f"{number}.outcome.json").write_bytes(b"{}")  # as in a root
    (row,) = duckdb.sql(f"""
        SELECT schema_version, key, len(vehicles), vehicles[2].impact.clock_h, events[1].code
        FROM read_parquet('{tmp_path}/*.parquet') WHERE len(vehicles) = 2
    """).fetchall()
    assert row == (SCHEMA_VERSION, "2023-519001", 2, 3.0, 12)
    frame = pd.read_parquet(sorted(tmp_path.glob("*.parquet")))
    assert list(frame.columns) == [column.name for column in CRASH_RECORD.columns]
    assert sorted(len(vehicles) for vehicles in frame["vehicles"]) == [1, 2]


@pytest.mark.parametrize("data", [b"", b"{}", b"PAR1", b"PAR1 and no more PAR1"])
def test_damaged_files_are_failures_that_say_what_to_do(data: bytes) -> None:
    with pytest.raises(Failure, match="run crash_record again"):
        record_from_parquet(data)
