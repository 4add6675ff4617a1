"""Tags of ASAM OpenLABEL 1.0.0 for each crash, for searches in scenario databases.

Types are classes of OpenLABEL's ontology of scenario tags, which follows BSI PAS 1883:2020 for the operational design
domain. A tag is set only for facts from the report or the reconstruction.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from trace_dag.crash.codes.odd import odd_terms
from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.export.formats.exporter import Exporter
from trace_dag.flow.artefacts import ESTIMATE, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.osm.types import Rights
from trace_dag.simulation.states import Manoeuvre, ParticipantState
from trace_dag.simulation.types import BodyKind
from trace_dag.version import __version__

_ONTOLOGY: Final = "https://openlabel.asam.net/V1-0-0/ontologies/openlabel_ontology_scenario_tags.ttl"
_ONTOLOGY_UID: Final = "0"

_VEHICLES: Final = {
    VehicleClass.MOTORCYCLE: ("VehicleMotorcycle",),
    VehicleClass.BUS: ("VehicleBus",),
    VehicleClass.TRUCK: ("VehicleTruck",),
    VehicleClass.LIGHT_TRUCK: ("VehicleTruck",),
    VehicleClass.TRACTOR_TRAILER: ("VehicleTruck", "VehicleTrailer"),
    VehicleClass.VAN: ("VehicleVan",),
}
_PEOPLE: Final = {
    BodyKind.PEDESTRIAN: ("HumanPedestrian",),
    BodyKind.CYCLIST: ("HumanCyclist", "VehicleCycle"),
    BodyKind.CONVEYANCE: ("RoadUserHuman",),
    BodyKind.ANIMAL: ("RoadUserAnimal",),
}
_MOTIONS: Final = {
    Manoeuvre.TURN_LEFT: "MotionTurnLeft",
    Manoeuvre.TURN_RIGHT: "MotionTurnRight",
    Manoeuvre.U_TURN: "MotionUTurn",
    Manoeuvre.LANE_CHANGE_LEFT: "MotionLaneChangeLeft",
    Manoeuvre.LANE_CHANGE_RIGHT: "MotionLaneChangeRight",
    Manoeuvre.PASS: "MotionOvertake",
    Manoeuvre.STOPPED: "MotionStop",
    Manoeuvre.STAND: "MotionStop",
    Manoeuvre.STARTING: "MotionAway",
    Manoeuvre.BACKING: "MotionReverse",
    Manoeuvre.CROSS_FROM_LEFT: "MotionCross",
    Manoeuvre.CROSS_FROM_RIGHT: "MotionCross",
}


class OpenLabel(Exporter):
    """``<key>.json`` for each crash."""

    def of_crash(self, crash: CrashFiles) -> Mapping[str, bytes]:
        record, network = crash.load(RECORD), crash.load(ROAD_MAP)
        parties = crash.load(ESTIMATE).hypotheses[crash.load(VERDICT).hypothesis].participants
        about = {
            "scenarioUniqueReference": crash.key,
            "scenarioName": f"Crash {crash.key}",
            "scenarioDescription": record.summary,
            "scenarioDefinition": "scenario.xosc",
            "scenarioDefinitionLanguageURI": "https://www.asam.net/standards/detail/openscenario-xml/",
            "licenseURI": f"https://spdx.org/licenses/{Rights.of([network.attribution]).licence}",
        }
        tags = [_tag(name, text) for name, text in about.items()]
        tags += [_tag(name) for name in dict.fromkeys((*_of_report(record), *_of_parties(parties)))]
        document = {
            "openlabel": {
                "metadata": {
                    "schema_version": "1.0.0",
                    "name": crash.key,
                    "annotator": f"trace-dag {__version__}",
                    "tagged_file": "scenario.xosc",
                },
                "ontologies": {_ONTOLOGY_UID: _ONTOLOGY},
                "tags": {str(number): tag for number, tag in enumerate(tags)},
            }
        }
        return {f"{crash.key}.json": (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()}


def _tag(name: str, text: str | None = None) -> dict[str, Any]:
    data = {} if text is None else {"tag_data": {"text": [{"type": "value", "val": text}]}}
    return {"type": name, "ontology_uid": _ONTOLOGY_UID, **data}


def _of_report(record: CrashRecord) -> Iterator[str]:
    said: list[tuple[str, int | str | None]] = [
        ("LGT_COND", record.light_code),
        ("WEATHER", record.weather_code),
        ("FUNC_SYS", record.function_class_code),
        ("TYP_INT", record.road_topology),
        *(("VSURCOND", vehicle.surface_condition_code) for vehicle in record.vehicles),
    ]
    for term in odd_terms(said):
        yield from term.tags


def _of_parties(parties: Sequence[ParticipantState]) -> Iterator[str]:
    for each in parties:
        kind = BodyKind(each.kind)
        yield from _VEHICLES.get(each.vehicle_class, ("VehicleCar",)) if kind not in _PEOPLE else _PEOPLE[kind]
        if each.manoeuvre in _MOTIONS:
            yield _MOTIONS[each.manoeuvre]
        elif each.initial_speed_mps > 0.0:
            yield "MotionWalk" if kind in (BodyKind.PEDESTRIAN, BodyKind.ANIMAL) else "MotionDrive"
