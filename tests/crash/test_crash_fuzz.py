"""Reports that were damaged at random or on purpose: always a record or a rejection, never anything else.

``TRACE_DAG_FUZZ_MUTATIONS`` sets how many mutations are tried (default 250).
"""

from __future__ import annotations

import os
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import FrameType

import pytest
from crash_reports import report
from loopback import Answer, serving

from trace_dag.common.errors import Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.completeness import check
from trace_dag.crash.folder import identify, scan
from trace_dag.crash.listing import list_report
from trace_dag.crash.parse import read_report
from trace_dag.crash.tables import record_from_parquet, record_to_parquet

MUTATIONS = int(os.environ.get("TRACE_DAG_FUZZ_MUTATIONS", "250"))
TIME_LIMIT_S = 5  # of processor time: the machine may do other things too
KEY = re.compile(r"[12][0-9]{3}-[1-9][0-9]{4,5}")
VALUES = [
    b"", b"-1", b"0", b"999999999999", b"1e309", b"NaN", b"inf", b"0x10", b"1_0", b"\xd9\xa1", b"&", b"&amp;", b"&#0;",
    b"&#x1F600;", b"&undefined;", b"<", b"]]>", b"<![CDATA[12]]>", b"<!-- -->", b"<?pi?>", b"../../etc/passwd", b"\x00",
    b"\xff\xfe", b"'; DROP TABLE crashes; --", b"%s%n", b"1" * 5000, b"Unknown", b"12 12", b" 12 ", b"12.0", b"12.5",
]  # fmt: skip


def mutated(data: bytes, rng: random.Random) -> bytes:
    """``data`` with one to four changes of the kinds files suffer."""
    for _ in range(rng.randint(1, 4)):
        data = rng.choice(_CHANGES)(data, rng)
    return data


def _flip(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) or 1)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _delete(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) or 1)
    return data[:at] + data[at + rng.choice([1, 2, 10, 1000]) :]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) or 1)
    length = rng.choice([1, 10, 500, 5000])
    return data[: at + length] + data[at:]


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) or 1)]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) or 1)
    return data[:at] + rng.choice(VALUES) + data[at:]


def _value(data: bytes, rng: random.Random) -> bytes:
    leaves = list(re.finditer(rb">([^<>]*)</", data))
    if not leaves:
        return data
    leaf = rng.choice(leaves)
    number = str(rng.choice([rng.randrange(100), rng.randrange(1000), rng.randrange(10**6)])).encode()
    return data[: leaf.start(1)] + rng.choice([*VALUES, *[number] * 20]) + data[leaf.end(1) :]


def _tag(data: bytes, rng: random.Random) -> bytes:
    tags = list(re.finditer(rb"</?([A-Za-z_0-9]+)", data))
    if not tags:
        return data
    tag, other = rng.choice(tags), rng.choice(tags)
    return data[: tag.start(1)] + other.group(1) + data[tag.end(1) :]


def _drop_element(data: bytes, rng: random.Random) -> bytes:
    elements = list(re.finditer(rb"<([A-Za-z_0-9]+)>[^<>]*</\1>", data))
    element = rng.choice(elements) if elements else None
    return data if element is None else data[: element.start()] + data[element.end() :]


def _nest(data: bytes, rng: random.Random) -> bytes:
    at, depth = data.find(b"<Vehicles>"), rng.choice([10, 300, 20_000])
    return data[:at] + b"<d>" * depth + b"</d>" * depth + data[at:] if at >= 0 else data


def _prologue(data: bytes, rng: random.Random) -> bytes:
    entity = rng.choice([b'"x"', b'SYSTEM "file:///etc/passwd"', b'SYSTEM "http://127.0.0.1:9/"'])
    start = data.find(b"<ResponseOf")
    return b"<!DOCTYPE r [<!ENTITY e " + entity + b">]>" + data[max(start, 0) :]


def _recode(data: bytes, rng: random.Random) -> bytes:
    text = data.decode("utf-8", errors="replace")
    return text.encode(rng.choice(["utf-16", "utf-32", "latin-1", "cp037"]), errors="replace")


_CHANGES = [_flip, _delete, _repeat, _truncate, _insert, *[_value] * 8, *[_tag] * 2, *[_drop_element] * 4, _nest,
            _prologue, _recode]  # fmt: skip


@pytest.fixture
def no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every attempt to open a connection fails the test."""

    def refuse(*_: object, **__: object) -> None:
        pytest.fail("a report opened a connection")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)


@pytest.fixture
def no_hang() -> Iterator[None]:
    """A single mutation that takes longer than the limit fails the test."""

    def late(_: int, frame: FrameType | None) -> None:
        pytest.fail(f"a report took longer than {TIME_LIMIT_S} s, at {frame}")

    previous = signal.signal(signal.SIGPROF, late)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0)
    signal.signal(signal.SIGPROF, previous)


@pytest.mark.usefixtures("no_network", "no_hang")
def test_mutated_reports_are_read_or_rejected(real_reports: dict[str, bytes], tmp_path: Path) -> None:
    rng = random.Random(2023)
    originals = [report(), *real_reports.values()]
    outcomes: Counter[str] = Counter()
    slowest_s = 0.0
    for number in range(MUTATIONS):
        data = mutated(rng.choice(originals), rng)
        settings = CrashSettings(repair_malformed=bool(number % 2))
        start_s = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, TIME_LIMIT_S)
        try:
            outcomes[_outcome(data, settings)] += 1
        except Exception as error:
            (tmp_path / "culprit.xml").write_bytes(data)
            pytest.fail(f"mutation {number} ({tmp_path / 'culprit.xml'}): {type(error).__name__}: {error}")
        slowest_s = max(slowest_s, time.process_time() - start_s)
    signal.setitimer(signal.ITIMER_PROF, 0)
    assert outcomes.total() == MUTATIONS
    assert {"accepted", "malformed_report"} <= set(outcomes), outcomes
    if "TRACE_DAG_FUZZ_MUTATIONS" in os.environ:
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        sys.stderr.write(f"\n{dict(outcomes)}, slowest {slowest_s:.3f} s, peak {peak_mb:.0f} MB\n")


def _outcome(data: bytes, settings: CrashSettings) -> str:
    """What becomes of a report on its way through the first two stages."""
    with suppress(Rejection):
        found = identify(data, name="report.xml")
        assert found is None or KEY.fullmatch(found[0])
    with suppress(Rejection):
        assert KEY.fullmatch(list_report(data, name="report.xml").key)
    try:
        record = read_report(data, name="report.xml", settings=settings)
        assert KEY.fullmatch(record.key)
        assert record_from_parquet(record_to_parquet(record)) == record
        check(record, settings)
    except Rejection as rejection:
        return rejection.reason.value
    return "accepted"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32", "cp037"])
@pytest.mark.parametrize("external", ["entity", "parameter entity", "dtd", "xinclude", "stylesheet"])
def test_nothing_is_fetched_for_a_report(encoding: str, external: str) -> None:
    with serving(lambda *_: Answer(b"<!ENTITY x 'y'>")) as server:
        prologue = {
            "entity": f'<!DOCTYPE r [<!ENTITY x SYSTEM "{server.url}/x">]>',
            "parameter entity": f'<!DOCTYPE r [<!ENTITY % x SYSTEM "{server.url}/x"> %x;]>',
            "dtd": f'<!DOCTYPE r SYSTEM "{server.url}/r.dtd">',
            "xinclude": "",
            "stylesheet": f'<?xml-stylesheet href="{server.url}/x.xsl" type="text/xsl"?>',
        }[external]
        place = f'<x:include xmlns:x="http://www.w3.org/2001/XInclude" href="{server.url}/x"/>'
        body = report({"TWAY_ID": "ROAD"}).decode().split("?>", 1)[1]
        body = body.replace("ROAD", {"entity": "&x;", "xinclude": place}.get(external, "ROAD"))
        text = f"<?xml version='1.0' encoding='{encoding}'?>{prologue}{body}"
        for settings in (CrashSettings(), CrashSettings(repair_malformed=True)):
            _outcome(text.encode(encoding), settings)
        assert server.requests == []


@pytest.mark.parametrize("encoding", ["utf-8", "cp037"])
def test_entities_are_not_expanded(encoding: str) -> None:
    lines = "".join(f"<!ENTITY e{n} '{f'&e{n - 1};' * 50}'>" for n in range(1, 8))
    prologue = f"<!DOCTYPE r [<!ENTITY e0 'bomb'>{lines}]>"
    body = report({"TWAY_ID": "ROAD"}).decode().split("?>", 1)[1].replace("ROAD", "&e7;")
    data = f"<?xml version='1.0' encoding='{encoding}'?>{prologue}{body}".encode(encoding)
    try:
        read = read_report(data, name="report.xml", settings=CrashSettings()).trafficway_1
    except Rejection as rejected:
        read = str(rejected)
    assert "bombbomb" not in read


@pytest.mark.parametrize(("size_mb", "limit_mb"), [(100, 50), (15, 250)])
def test_large_files_take_little_memory_and_time(size_mb: int, limit_mb: int) -> None:
    """Measured in a process of its own, over what its data take: 100 MB is refused, 15 MB just below the limit."""
    script = textwrap.dedent(
        """
        import resource, sys, time
        from crash_reports import report
        from trace_dag.crash.folder import identify
        from trace_dag.crash.parse import read_report
        from trace_dag.crash.tables import record_to_parquet
        from trace_dag.common.errors import Rejection
        from trace_dag.common.settings import CrashSettings

        def outcome(data, settings):
            try:
                identify(data, name="large.xml")
                return record_to_parquet(read_report(data, name="large.xml", settings=settings))
            except Rejection as rejection:
                assert rejection.reason == "malformed_report", rejection

        def used_kb():
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

        outcome(report(), CrashSettings())
        size, slowest, more = int(sys.argv[1]), 0, 0
        for filling in (b"<a/>", b"<a>x</a>", b"<a b='c'/>", b"x", b" ", b"&amp;", b"<a>", b"<V>&", b"<Vehicle/>"):
            data = report().replace(b"<Vehicles>", b"<Vehicles>" + filling * (size // len(filling)))
            before, start = used_kb(), time.process_time()
            for settings in (CrashSettings(), CrashSettings(repair_malformed=True)):
                outcome(data, settings)
            slowest, more = max(slowest, time.process_time() - start), more + used_kb() - before
        print(more / 1024, slowest)
        """
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(size_mb * 1_000_000)],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
    )
    more_mb, slowest_s = map(float, done.stdout.split())
    assert more_mb < limit_mb
    assert slowest_s < 5


def test_file_names_never_leave_the_folder(tmp_path: Path) -> None:
    """Keys become file names: whatever a report or its name says, they are two numbers and a hyphen."""
    hostile = ["..%2f..%2fetc.xml", "a b\n.xml", "-rf.xml", "2023-519001;ls.xml", "\u202e.xml"]
    for index, name in enumerate(hostile):
        (tmp_path / name).write_bytes(report({"ST_CASE": 519100 + index}))
    found = scan([tmp_path])
    assert len(found.reports) == len(hostile)
    assert all(KEY.fullmatch(entry.key) for entry in found.reports)
