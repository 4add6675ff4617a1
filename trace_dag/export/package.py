"""The scenario package of one crash: everything a tester needs in one archive, with its own documentation.

A package is a set of named files; :func:`package_files` makes them, :func:`zip_files` puts them into an archive: the
same content gives the same bytes. Nothing in it refers to the machine it was made on. :func:`package_files` takes a
crash on its road as simulated and judged: a verified crash or a variation of one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from io import BytesIO
from typing import Final, NamedTuple
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from trace_dag.agents.stored_traffic import StoredTraffic, traffic_to_json
from trace_dag.crash.keys import FARS
from trace_dag.crash.parties import party_label
from trace_dag.crash.record import CrashRecord
from trace_dag.export.documents import render_document
from trace_dag.osm.types import OsmFeature, Rights
from trace_dag.pages.canvas import as_png, pixels_of
from trace_dag.pages.pictures import WIDTH_PX, draw_crash
from trace_dag.pages.replay import replay_page
from trace_dag.pages.replay_content import ReplayContent, replay_content
from trace_dag.pages.replay_impacts import strikes
from trace_dag.reconstruction.samples.simulated import SampledRuns, samples_to_json
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import MapReport
from trace_dag.scenario.drawn_shapes import OBJECT_NOTE, names
from trace_dag.scenario.drives import Drive
from trace_dag.scenario.driving_files import courses_to_json, ensemble_to_json, lanes_to_json
from trace_dag.scenario.lights import crash_lights
from trace_dag.scenario.opendrive_surroundings import PlacedObject, add_objects, fixed_objects, surrounding_objects
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.scenario.traffic.surrounding import add_traffic
from trace_dag.scenario.trajectories import log_to_json
from trace_dag.simulation.states import StateEstimate, estimate_to_json
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.in_words import label_in_words
from trace_dag.verdict.types import Verdict, verdict_to_json
from trace_dag.version import __version__

MANIFEST = "manifest.json"

_CC0, _PUBLIC = "CC0-1.0", "US public domain"
_ZIP_DATE: Final = (1980, 1, 1, 0, 0, 0)  # the format's first: a fixed one keeps archives reproducible


@dataclass(frozen=True, eq=False)
class PackageInput:
    """One crash's artefacts. ``log`` is of the hypothesis that ``verdict`` names.

    ``report`` (its file's name and content), ``osm_xml`` and ``map_xodr`` enter as they are. ``network`` is the map as
    read, ``surroundings`` lie behind its roads. ``sampled`` has the outcomes of the estimate's draws, ``drives`` the
    planned motion of all parties without the crash. ``picture`` is the crash from above as PNG, ``replay`` the content
    of its replay; they are made if missing. ``traffic`` has the vehicles around the crash. ``variation`` describes the
    changes, as JSON, if this is a variation.
    """

    record: CrashRecord
    report: tuple[str, bytes]
    osm_xml: bytes
    map_xodr: bytes
    provenance: Mapping[str, object]
    network: RoadNetwork
    map_report: MapReport
    estimate: StateEstimate
    log: SimulationLog
    verdict: Verdict
    drives: Sequence[Drive]
    variation: Mapping[str, object] | None = None
    surroundings: Sequence[OsmFeature] = ()
    picture: bytes | None = None
    replay: ReplayContent | None = None
    sampled: SampledRuns | None = None
    traffic: StoredTraffic | None = None

    @property
    def rights(self) -> Rights:
        """Return the rights in the map and in works made of it."""
        return Rights.of([self.network.attribution])


class _File(NamedTuple):
    name: str
    what: str
    data: bytes
    licence: str = _CC0


def package_files(crash: PackageInput) -> dict[str, bytes]:
    """Return the files of a package by name, including ``manifest.json`` with their SHA-256 checksums."""
    files = [
        *_sources(crash),
        *_scenarios(crash),
        *_results(crash),
        _File(
            "LICENSES.md",
            "what may be done with it",
            render_document(
                "licenses.md.jinja",
                rights=crash.rights,
                inferred=crash.map_report.inferred_roads,
                registers=[crash.record.attribution] if crash.record.attribution else [],
                fars=crash.record.register == FARS,
            ),
        ),
    ]
    readme = _File("README.md", "this", _readme(crash, files))
    described = sorted([*files, readme])
    manifest = {
        "key": crash.record.key,
        "made_by": f"trace-dag {__version__}",
        "files": {
            file.name: {
                "sha256": hashlib.sha256(file.data).hexdigest(),
                "bytes": len(file.data),
                "licence": file.licence,
                "what": file.what,
            }
            for file in described
        },
    }
    return {**{file.name: file.data for file in described}, MANIFEST: _json(manifest)}


def zip_files(files: Mapping[str, bytes], *, folder: str) -> bytes:
    """Return an archive of ``files`` below ``folder``, the same bytes for the same content.

    >>> ZipFile(BytesIO(zip_files({"README.txt": b"A crash."}, folder="2023-319003"))).read("2023-319003/README.txt")
    b'A crash.'
    """
    stream = BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED) as archive:
        for name in sorted(files):
            archive.writestr(ZipInfo(f"{folder}/{name}", _ZIP_DATE), files[name], ZIP_DEFLATED)
    return stream.getvalue()


def _map_objects(crash: PackageInput) -> list[PlacedObject]:
    """Return the objects beside the roads: the fixed objects of the crash, and the surroundings."""
    items = crash.log.objects
    around = surrounding_objects(crash.network, crash.surroundings, without={item.osm_id for item in items})
    return [*fixed_objects(crash.network, items), *around]


def _sources(crash: PackageInput) -> list[_File]:
    objects = crash.log.objects
    beside = _map_objects(crash)
    legal = add_objects(write_opendrive(crash.network, marks="legal"), beside)
    crossable = add_objects(crash.map_xodr, beside)
    stand = f", with the {names(objects)} of the report" if objects else ": any may be crossed"
    rights = crash.rights
    name, data = crash.report
    if crash.record.attribution:
        report = _File(name, "what its register says of the crash", data, crash.record.attribution)
    elif rights.fictional:
        report = _File(name, "a fictional report as NHTSA's CrashAPI would serve it", data, rights.licence)
    else:
        report = _File(name, "the report as NHTSA's CrashAPI serves it", data, _PUBLIC)
    return [
        report,
        _File("summary.txt", "the report in words", (crash.record.summary + "\n").encode()),
        _File("map.osm", "the OSM data the maps were made of", crash.osm_xml, rights.licence),
        _File("map.xodr", f"OpenDRIVE 1.7; its marks allow the crash{stand}", crossable, rights.licence),
        _File("map_legal_marks.xodr", "the same roads with the marks the law paints", legal, rights.licence),
    ]


def _scenarios(crash: PackageInput) -> list[_File]:
    scenarios = OpenScenarios(crash.record, crash.network, crash.log)

    def scenario(name: str, flavour: Flavour, what: str) -> _File:
        return _File(name, what, scenarios.write(flavour))

    files = [
        scenario("scenario.xosc", Flavour(), "OpenSCENARIO 1.2: everybody follows their trajectory"),
        scenario("scenario.carla.xosc", Flavour(carla=True), "OpenSCENARIO 1.0 for CARLA's ScenarioRunner 0.9.16"),
    ]
    for k, each in enumerate(scenarios.lights[1:], 1):
        what = f"OpenSCENARIO 1.2 with the other reading of the lights: {each.in_words}"
        files.append(scenario(f"scenario.lights_{k + 1}.xosc", Flavour(lights=k), what))
    if crash.traffic is not None:
        surrounded = add_traffic(crash.log, crash.traffic.traffic, throughout=True)
        data = OpenScenarios(crash.record, crash.network, surrounded).write()
        what = "OpenSCENARIO 1.2 with the vehicles around the crash that are on the map all the time (S1, ...)"
        files.append(_File("scenario.traffic.xosc", what, data))
    for number in _left_free(crash.log):
        what = f"with V{number} left to a controller of yours"
        files += [
            scenario(f"scenario.free_V{number}.xosc", Flavour(free=number), f"OpenSCENARIO 1.2, {what}"),
            scenario(
                f"scenario.conflict_V{number}.xosc",
                Flavour(free=number, keeps_conflict=True),
                f"OpenSCENARIO 1.2, {what}, whom it met coming when it comes",
            ),
            scenario(
                f"scenario.carla.free_V{number}.xosc",
                Flavour(carla=True, free=number),
                f"for ScenarioRunner, {what} (external_control)",
            ),
        ]
    return files


def _left_free(log: SimulationLog) -> list[int]:
    """Return the vehicles that a controller can drive: each one, if there is another party."""
    if len(log.parties) < 2:
        return []
    return sorted(each.number for each in log.parties if not log.is_figure(each.number))


def _results(crash: PackageInput) -> list[_File]:
    content = crash.replay or replay_content(
        crash.record,
        crash.network,
        crash.log,
        crash.verdict,
        surroundings=crash.surroundings,
        sampled=crash.sampled,
        in_3d=False,
    )
    replay, of_the_map = replay_page(content, in_3d=False), crash.rights.licence
    key, lights, struck = crash.record.key, crash_lights(crash.record, crash.network, crash.log), strikes(crash.log)
    files = [
        _File("states.json", "hypotheses: initial and impact states, evidence", estimate_to_json(crash.estimate)),
        _File("trajectories.json", "the simulated motion and contacts", log_to_json(key, crash.log)),
        _File(
            "courses.json",
            "everybody's course without the crash, each driver's route and goal",
            courses_to_json(key, crash.drives),
        ),
        _File(
            "lanes.json",
            "the lanes of the map as points, with the lanes after and beside each",
            lanes_to_json(key, crash.network),
            of_the_map,
        ),
        _File("map_report.json", "the crash's place on the map, gates", crash.map_report.to_json()),
        _File("verdict.json", "every criterion with its value and threshold", verdict_to_json(crash.verdict)),
        _File("replay.html", "the crash to watch, in any browser", replay, of_the_map),
        _File("picture.png", "the crash from above", crash.picture or _drawn(crash), of_the_map),
        _File("provenance.json", "code, settings and inputs of every step", _json(crash.provenance)),
    ]
    if lights:
        what = "traffic lights by the ids of the map's signals: programs from the start on, and what the parties met"
        files.append(_File("lights.json", what, _json([asdict(each) for each in lights])))
    if struck:
        files.append(_File("strikes.json", "of each person struck: trigger, path, impact point", _json(struck)))
    if crash.sampled is not None:
        what = (
            "what the report leaves open: draws of the crash, weighed by the report, their intervals and likely courses"
        )
        files.append(_File("intervals.json", what, samples_to_json(crash.sampled)))
        what = "courses that agree with the report as weighted plans of all parties, for an agent to be put into each"
        files.append(_File("ensemble.json", what, ensemble_to_json(key, crash.estimate, crash.sampled)))
    if crash.traffic is not None:
        what = "vehicles around the crash, usual for its hour and roads, simulated by SUMO; the report has none of them"
        files.append(_File("traffic.json", what, traffic_to_json(crash.traffic)))
    if crash.variation is not None:
        files.append(_File("variation.json", "what was changed in the crash", _json(crash.variation)))
    return files


def _drawn(crash: PackageInput) -> bytes:
    svg = draw_crash(
        crash.record,
        crash.network,
        crash.map_report,
        crash.estimate,
        crash.log,
        crash.verdict,
        surroundings=crash.surroundings,
    )
    return as_png(pixels_of(svg, WIDTH_PX))


def _readme(crash: PackageInput, files: list[_File]) -> bytes:
    return render_document(
        "package_readme.md.jinja",
        rights=crash.rights,
        crash=crash.record,
        variation=crash.variation,
        frame=crash.network.frame,
        contact=crash.log.first_contact,
        verdict=crash.verdict,
        label_in_words=label_in_words,
        judged=[criterion for criterion in crash.verdict.criteria if criterion.reason is not None],
        log=crash.log,
        people={party_label(number): body for number, body in sorted(crash.log.bodies.items()) if body.is_figure},
        strikes=strikes(crash.log),
        objects=crash.log.objects,
        note=OBJECT_NOTE,
        left_free=_left_free(crash.log),
        party_label=party_label,
        estimated_by=crash.estimate.run.in_words(),
        vehicles={vehicle.number: vehicle for vehicle in crash.record.vehicles},
        files=files,
        inferred=crash.map_report.inferred_roads,
    )


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
