"""The scenario package of one verified crash: everything a tester needs, in one archive that explains itself.

A package is a set of named files; :func:`package_files` makes them, :func:`zip_files` puts them into an archive that is
the same byte for byte whenever its content is. Nothing in it refers to the machine it was made on.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from trace_dag import __version__
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.network import RoadNetwork
from trace_dag.roads.opendrive_writer import write_opendrive
from trace_dag.roads.report import MapReport
from trace_dag.scenario.openscenario import Flavour, write_openscenario
from trace_dag.scenario.pictures import draw_crash
from trace_dag.scenario.replay import write_html_player
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import StateEstimate
from trace_dag.verdict.types import Verdict

# Zip entries carry a date; a fixed one (the format's first) keeps archives reproducible.
_ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class PackageInput:
    """One crash's artefacts, as stored and as read. ``log`` is of the hypothesis that ``verdict`` names."""

    record: CrashRecord
    report_xml: bytes
    osm_xml: bytes
    map_xodr: bytes
    estimate_json: bytes
    verdict_json: bytes
    provenance: Mapping[str, object]
    network: RoadNetwork
    map_report: MapReport
    estimate: StateEstimate
    log: SimulationLog
    verdict: Verdict


def package_files(crash: PackageInput) -> dict[str, bytes]:
    """The files of a package by name, ``manifest.json`` with their SHA-256 checksums among them."""
    ego = min(vehicle.number for vehicle in crash.log.vehicles)
    files = {
        "README.md": _readme(crash, ego).encode(),
        "LICENSES.md": _template("package_licenses.md").encode(),
        "report.xml": crash.report_xml,
        "summary.txt": (crash.record.summary + "\n").encode(),
        "map.osm": crash.osm_xml,
        "map.xodr": crash.map_xodr,
        "map_legal_marks.xodr": write_opendrive(crash.network, marks="legal"),
        "states.json": crash.estimate_json,
        "trajectories.json": _trajectories(crash.log),
        "scenario.xosc": write_openscenario(crash.record, crash.log),
        "scenario.free_ego.xosc": write_openscenario(crash.record, crash.log, flavour=Flavour(free_ego=ego)),
        "scenario.carla.xosc": write_openscenario(crash.record, crash.log, flavour=Flavour(minor_revision=0)),
        "verdict.json": crash.verdict_json,
        "replay.html": write_html_player(crash.record, crash.network, crash.log, crash.verdict),
        "picture.png": draw_crash(
            crash.record, crash.network, crash.map_report, crash.estimate, crash.log, crash.verdict
        ),
        "provenance.json": _json(crash.provenance),
    }
    manifest = {
        "key": crash.record.key,
        "made_by": f"trace-dag {__version__}",
        "files": {
            name: {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
            for name, data in sorted(files.items())
        },
    }
    return {**files, "manifest.json": _json(manifest)}


def zip_files(files: Mapping[str, bytes], *, folder: str) -> bytes:
    """An archive of ``files`` below ``folder``, the same bytes for the same content."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(f"{folder}/{name}", _ZIP_EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name])
    return stream.getvalue()


def _readme(crash: PackageInput, ego: int) -> str:
    from jinja2 import Environment, StrictUndefined

    template = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False).from_string(  # noqa: S701 - Markdown
        _template("package_readme.md.jinja")
    )
    contact = crash.log.first_contact
    return template.render(
        crash=crash.record, frame=crash.network.frame, ego=ego, contact=contact, verdict=crash.verdict, log=crash.log
    )


def _template(name: str) -> str:
    return resources.files("trace_dag.scenario").joinpath("templates", name).read_text(encoding="utf-8")


def _trajectories(log: SimulationLog) -> bytes:
    """The driven motion, columns per vehicle, each number rounded to what is meant (0.1 mm, 0.1 mm/s, 10 µrad)."""
    columns = ("time_s", "x_m", "y_m", "z_m", "heading_rad", "speed_mps")
    vehicles = {
        str(vehicle.number): {name: [round(float(value), 5) for value in getattr(vehicle, name)] for name in columns}
        for vehicle in log.vehicles
    }
    return _json(
        {
            "frame": "x east, y north of the reported point (m), heading counter-clockwise from east (rad)",
            "vehicles": vehicles,
        }
    )


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
