"""What reads bytes from outside, each with inputs that are right, to be damaged, and with what it may raise."""

from __future__ import annotations

import functools
import io
import json
import os
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import osmium

from tests import cases, model_server
from tests.crash import fars_tables
from tests.verdict.crashes import CROSSROADS, STREET
from trace_dag.agents.evaluation.agent_protocol import answer_from_bytes, answer_to_bytes, problem_of
from trace_dag.agents.evaluation.agents import AgentFault, Motion
from trace_dag.common.errors import DamagedFile, Rejection, UserError
from trace_dag.common.settings import OsmSettings
from trace_dag.common.settings_sources import load_settings
from trace_dag.crash.completeness import check
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.crash.parse import read_report
from trace_dag.flow import artefacts
from trace_dag.language.answer import WrongAnswer, decide, form, parse
from trace_dag.osm.extraction import Around, UnreadableMapError, read_around, read_header
from trace_dag.osm.map_check import MapChecker
from trace_dag.osm.types import BoundingBox
from trace_dag.osm.xml import read_osm
from trace_dag.reading.opening import open_place
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.simulation.driving import Pedals

Read = Callable[[bytes, Path], object]
_CRASH = "2023-319003"
_OF_A_PACKAGE = (
    artefacts.REPORT_XML,
    artefacts.RECORD,
    artefacts.EXTRACT,
    artefacts.ROAD_MAP,
    artefacts.MAP_REPORT,
    artefacts.ESTIMATE,
    artefacts.VERDICT,
)


@dataclass(frozen=True)
class Target:
    """``read`` is given damaged bytes and an empty folder, ``seeds`` are right, ``most_s`` is for one input."""

    read: Read
    seeds: tuple[bytes, ...]
    raises: tuple[type[Exception], ...]
    most_s: float = 5.0


def _report(data: bytes, _: Path) -> None:
    record = read_report(data, name="report.xml", settings=cases.SETTINGS.crash)
    check(record, cases.SETTINGS.crash)


def _fars_csv(data: bytes, folder: Path) -> None:
    """Tables follow each other, each after a line with its name."""
    for part in data.split(b"\x1e")[:12]:
        name, _, content = part.partition(b"\n")
        if name.isalnum():
            (folder / f"{name.decode(errors='replace')[:20]}.csv").write_bytes(content)
    source = FarsCsvSource.open(folder)
    source.listings()
    for _, report in source.reports():
        _report(report, folder)


def _osm_xml(data: bytes, folder: Path) -> None:
    path = folder / "map.osm"
    path.write_bytes(data)
    with suppress(UserError, DamagedFile):
        read_osm(data, name="map.osm")
    _extract(path)


def _osm_pbf(data: bytes, folder: Path) -> None:
    path = folder / "map.osm.pbf"
    path.write_bytes(data)
    _checker(os.getpid()).check(path)
    _extract(path)


@functools.cache
def _checker(process: int) -> MapChecker:
    """One for all maps of a process, ended with it; a forked process has none of its parent's."""
    return MapChecker()


def _extract(path: Path) -> None:
    header = read_header(path)
    box = header.box or BoundingBox(40.0, -99.0, 41.0, -98.0)
    read_around(path, header, [Around("2023-1", box, box)], OsmSettings())


def _opendrive(data: bytes, _: Path) -> None:
    network = read_opendrive(data, name="map.xodr")
    for lane in network.drivable_lanes()[:3]:
        network.pose(lane, 0.0)
    network.nearest_lanes(0.0, 0.0, 5.0)


def _package(data: bytes, folder: Path) -> None:
    path = folder / "package.zip"
    path.write_bytes(data)
    for key, crash in open_place(path).items():
        assert key
        for artefact in _OF_A_PACKAGE:
            if crash.stored.has(artefact):
                with suppress(UserError, DamagedFile, Rejection):
                    crash.stored.load(artefact)


def _settings(data: bytes, _: Path) -> None:
    load_settings(data)


def _agent_answer(data: bytes, _: Path) -> None:
    assert isinstance(problem_of(answer_from_bytes(data)), str)


def _model_answer(data: bytes, _: Path) -> None:
    case = _case()
    text = data.decode(errors="replace")
    numbers = tuple(vehicle.number for vehicle in case.record.vehicles[:2])
    for kind in ("segments", "coordinates"):
        with suppress(WrongAnswer):
            answer = parse(text, form(kind))
            decide(answer, _choices(), case.record, (numbers[0], numbers[1]), lead_time_s=5.0)


# --- seeds ------------------------------------------------------------------------------------------------------------
_made: dict[str, object] = {}


def _case() -> cases.Case:
    if "case" not in _made:
        _made["case"] = cases.sample_case(_CRASH)
    case = _made["case"]
    assert isinstance(case, cases.Case)
    return case


def _choices():
    if "choices" not in _made:
        _made["choices"] = model_server.choices_of(_case())
    return _made["choices"]


def targets(package: Path) -> Mapping[str, Target]:
    """All targets; ``package`` is one of a crash of the bundled sample, whose files are the seeds."""
    with zipfile.ZipFile(package) as archive:
        files = {name.partition("/")[2]: archive.read(name) for name in archive.namelist()}
    sample = sorted((cases.SAMPLE / "reports").glob("*.xml"))
    people = sorted((cases.SAMPLE / "people" / "reports").glob("*.xml"))
    reports = tuple(path.read_bytes() for path in (*sample[:6], *people[:4]))
    path_m = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 1.0]])
    moves = (
        Motion(target_speed_mps=3.0, path_m=path_m),
        Motion(acceleration_mps2=-3.0, steer_rad=0.1),
        Pedals(0.1, 0.2, 0.3, True),
    )
    right = json.dumps(model_server.right_answer(_case())).encode()
    return {
        "report": Target(_report, reports, (Rejection,)),
        "report-rows": Target(_report, (_ROWS,), (Rejection,)),
        "fars-csv": Target(_fars_csv, (_tables(reports[:3]),), (UserError, Rejection)),
        "osm-xml": Target(_osm_xml, (files["map.osm"],), (UserError, UnreadableMapError)),
        "osm-pbf": Target(_osm_pbf, (pbf(files["map.osm"]),), (UserError, UnreadableMapError)),
        "opendrive": Target(_opendrive, (write_opendrive(STREET), write_opendrive(CROSSROADS)), (UserError,)),
        "package": Target(_package, (_small(files),), (UserError, DamagedFile)),
        "settings": Target(_settings, (_TOML,), (UserError,)),
        "agent-answer": Target(_agent_answer, tuple(map(answer_to_bytes, moves)), (AgentFault,)),
        "model-answer": Target(_model_answer, (right, b"```json\n" + right + b"\n```"), ()),
    }


_ROWS = b"""{"case_year": 2023, "state_case": 510001, "tables": {
 "accident": [{"ST_CASE": "510001", "YEAR": "2023",
   "LATITUDE": "37.5", "LONGITUD": "-77.4", "VE_FORMS": "2", "TYP_INT": "2"}],
 "vehicle": [{"VEH_NO": "1", "IMPACT1": "12", "P_CRASH1": "1"}, {"VEH_NO": "2", "IMPACT1": "3", "P_CRASH1": "11"}],
 "cevent": [{"EVENTNUM": "1", "SOE": "12", "VNUMBER1": "1", "AOI1": "12", "VNUMBER2": "2", "AOI2": "3"}]}}
"""
_TOML = b"""[crash]
kinds = ["vehicles"]
[osm]
radius_m = 250.0
[states]
estimator = "analytic"
[sim]
step_s = 0.002
[execution]
workers = 2
"""


def _tables(reports: tuple[bytes, ...]) -> bytes:
    tables = fars_tables.tables_of(reports)
    return b"\x1e".join(f"{name}\n{fars_tables.csv_of(rows)}".encode() for name, rows in tables.items() if rows)


def pbf(xml: bytes) -> bytes:
    """The same map as libosmium writes it."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "map.osm", Path(folder) / "map.osm.pbf"
        source.write_bytes(re.sub(rb'(id|ref)="-', rb'\1="', xml))  # a fictional town has ids below 0
        plain = osmium.io.File(str(target), "pbf,pbf_compression=none,pbf_dense_nodes=false")
        with osmium.SimpleWriter(plain) as writer:
            for each in osmium.FileProcessor(str(source)):
                writer.add(each)
        return target.read_bytes()


def _small(files: Mapping[str, bytes]) -> bytes:
    """The package without its pictures, not compressed, so that damage reaches what it holds."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, data in files.items():
            if name.endswith((".xml", ".osm", ".xodr", ".json")):
                archive.writestr(f"{_CRASH}/{name}", data)
    return stream.getvalue()


def with_right_checksums(package: bytes) -> bytes:
    """The bytes of a zip archive whose stored files have been damaged, with checksums that fit again."""
    data = bytearray(package)
    try:
        with zipfile.ZipFile(io.BytesIO(package)) as archive:
            for entry in archive.infolist():
                at = entry.header_offset
                names, extra = struct.unpack_from("<HH", data, at + 26)
                begin = at + 30 + names + extra
                struct.pack_into("<I", data, at + 14, zlib.crc32(data[begin : begin + entry.file_size]))
    except (zipfile.BadZipFile, struct.error, ValueError, NotImplementedError, OSError):
        return package
    return bytes(data)
