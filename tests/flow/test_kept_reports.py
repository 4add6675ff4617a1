"""Reports of tables: many to a file, found one by one, and kept anew only where they changed or are lost."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from trace_dag.common.errors import DamagedFile
from trace_dag.common.storage.checksums import check_table, write_table
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.kept_files import keep_reports, read_kept

REPORTS = {f"made-{number}": b'{"key": "made-%d"}' % number for number in range(2_500)}


def test_reports_are_kept_together_and_read_one_by_one(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    taken = keep_reports(storage, REPORTS.items(), {})
    assert len(storage.list("reports")) == 3
    assert {key: read_kept(storage, key, source) for key, source in taken.items()} == REPORTS


def test_what_changed_goes_into_a_file_of_its_own_and_the_others_stay_where_they_are(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    before = keep_reports(storage, REPORTS.items(), {})
    now = keep_reports(storage, {"made-new": b"{}", **REPORTS, "made-7": b"changed"}.items(), before)
    assert {key for key, source in now.items() if source != before.get(key)} == {"made-7", "made-new"}
    assert read_kept(storage, "made-7", now["made-7"]) == b"changed"
    assert len(storage.list("reports")) == 4


def test_a_lost_file_is_made_again_from_the_table(tmp_path: Path) -> None:
    storage = Storage(tmp_path)
    before = keep_reports(storage, REPORTS.items(), {})
    storage.delete(before["made-0"].location)
    with pytest.raises(FileNotFoundError):
        read_kept(storage, "made-0", before["made-0"])
    now = keep_reports(storage, REPORTS.items(), before)
    assert read_kept(storage, "made-0", now["made-0"]) == REPORTS["made-0"]


def test_any_changed_byte_of_a_table_is_found() -> None:
    data = write_table(pa.table({"key": ["a", "b"]}), b'{"name": "x"}')
    table, about = check_table(data, name="x.parquet")
    assert (table.to_pylist(), about) == ([{"key": "a"}, {"key": "b"}], b'{"name": "x"}')
    for at in range(len(data)):
        changed = data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]
        with pytest.raises(DamagedFile):
            check_table(changed, name="x.parquet")
