"""Score what a language model reads from narratives, field by field, against coded reports of the same crashes.

    python -m lab narratives [--narratives FOLDER] [--coded REPORTS ...] [--register NAME TABLE] [--stand-in]

``FOLDER`` holds a text file for each crash, named by the id of its coded report: the key of a CrashAPI report below
``REPORTS`` (2023-319003.txt), or the id of a row of ``TABLE``. Without arguments they are the ten of the sample. The
model is that of the settings (``TRACE_DAG_STATES__LLM_MODEL``). With ``--stand-in`` it is the answers beside the
narratives, written by hand, which show that the path works and say nothing about any model.

In each field that the coded report has, the narrative's value is right, wrong or missing. Streets are compared as
names, bodies by their class, speeds within 1 mph, areas by whether they overlap; an event by its kind and its parties.
A field that only the narrative has cannot be judged here. Units are those of the same number, persons of the same
order.

If to get cases: NHTSA publishes a narrative beside the coded tables of each crash that its investigators looked
into. CISS (since 2016) and CIREN: case by case at https://crashviewer.nhtsa.dot.gov, the tables of a year at
https://www.nhtsa.gov/file-downloads?p=nhtsa/downloads/CISS/. They are public and name no place and no street: they
can be scored, and not be reconstructed. Published for CIREN: Extended Scenic road 100 %, actors 98 %; SAFE 94 and 80
%."""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from lab.cohorts import SAMPLE
from trace_dag.common.settings import CrashSettings
from trace_dag.common.settings_sources import load_settings
from trace_dag.common.units import MPS_PER_MPH
from trace_dag.crash.codes.table import code_table
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.derive import impact_area
from trace_dag.crash.folder import scan
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord, NonMotorist, PreCrashMovement, VehicleRecord
from trace_dag.crash.registers.table import RegisterTable
from trace_dag.crash.reported_place import Place
from trace_dag.language.answer import WrongAnswer
from trace_dag.language.hypotheses import llm_client
from trace_dag.language.narratives.record import record_of
from trace_dag.language.narratives.source import Model, narratives_in, read_narrative
from trace_dag.language.narratives.vocabulary import vocabulary
from trace_dag.language.store import StoredAnswer
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity

NARRATIVES: Final = SAMPLE / "narratives"
REPORTS: Final = (SAMPLE / "reports", *(SAMPLE / each / "reports" for each in ("people", "chains", "roadside")))
_NOWHERE: Final = Place(45.0, -100.0)
"""A place for a record that is only read."""
T = TypeVar("T")


class StandIn:
    """Answers from the hand-written file beside the narratives, without a model."""

    def __init__(self, folder: Path = NARRATIVES) -> None:
        self._answers: dict[str, Any] = json.loads((folder / "stand_in.json").read_text())
        self._texts = {each.id: " ".join(each.text.split()) for each in narratives_in(folder)}

    def ask(self, messages: list[dict[str, str]], *, prompt: str, schema: Mapping[str, Any]) -> StoredAnswer:
        """See :class:`trace_dag.language.narratives.source.Model`."""
        del prompt, schema
        return StoredAnswer(self.answer(messages), "stop", "stand-in", 0, 0, 0.0, 0.0)

    def answer(self, messages: Sequence[Mapping[str, str]]) -> str:
        """Return the answer to a question, as a provider would send it."""
        question = messages[1]["content"]
        (name,) = (name for name, text in self._texts.items() if json.dumps(text, ensure_ascii=False)[1:-1] in question)
        said = self._answers[name]
        if "<statements>" in question:
            text = question.partition("<statements>")[2].partition("</statements>")[0]
            refused = said.get("refused", ())
            return json.dumps({"supported": [e["number"] for e in json.loads(text) if e["statement"] not in refused]})
        facts = [dict(zip(("unit", "field", "value", "words"), each, strict=True)) for each in said["facts"]]
        parts = ("event", "unit", "other_unit", "area", "other_area", "words")
        return json.dumps({"facts": facts, "events": [dict(zip(parts, each, strict=True)) for each in said["events"]]})


@dataclass(frozen=True)
class Compared:
    """A field of one crash: whether the narrative agrees with the coded report; None if it lacks the field."""

    field: str
    right: bool | None


def compared(coded: CrashRecord, read: CrashRecord) -> Iterator[Compared]:
    """Yield every field that the coded report knows, beside what was read."""
    yield from _streets(coded, read)
    for name, element in _OF_CRASH.items():
        yield from _field(name, getattr(coded, name), getattr(read, name), _same_meaning(element))
    units = [[*each.vehicles, *each.non_motorists] for each in (coded, read)]
    yield Compared("number of units", len(units[0]) == len(units[1]))
    by_number = {vehicle.number: vehicle for vehicle in read.vehicles}
    for vehicle in coded.vehicles:
        yield from _vehicle(vehicle, by_number.get(vehicle.number))
    for place, person in enumerate(coded.non_motorists):
        yield from _person(person, read.non_motorists[place] if place < len(read.non_motorists) else None)
    told = [_event(read, each) for each in read.events] if "events" not in read.implied else []
    for place, event in enumerate(coded.events):
        yield from _field("event", _event(coded, event), told[place] if place < len(told) else None)


_OF_CRASH: Final = {
    "manner_of_collision_code": "MAN_COLL",
    "intersection_type_code": "TYP_INT",
    "junction_relation_code": "RELJCT2",
    "light_code": "LGT_COND",
    "weather_code": "WEATHER",
}
_OF_VEHICLE: Final = {
    "avoidance_code": "P_CRASH3",
    "alignment_code": "VALIGN",
    "trafficway_code": "VTRAFWAY",
    "traffic_control_code": "VTRAFCON",
    "surface_condition_code": "VSURCOND",
}


def _field(
    name: str, coded: T | None, read: T | None, same: Callable[[T, T], bool] = lambda a, b: a == b
) -> Iterator[Compared]:
    if coded not in (None, "", (), PreCrashMovement.UNKNOWN):
        said = read not in (None, "", (), PreCrashMovement.UNKNOWN)
        yield Compared(name, same(coded, read) if said else None)  # type: ignore[arg-type]


def _same_meaning(element: str) -> Callable[[int, int], bool]:
    table = code_table(element)
    return lambda one, other: table.meaning(one) == table.meaning(other)


def _streets(coded: CrashRecord, read: CrashRecord) -> Iterator[Compared]:
    said = tuple(name for name in (read.trafficway_1, read.trafficway_2) if name)
    for name in filter(None, (coded.trafficway_1, coded.trafficway_2)):
        yield from _field("street", name, said, lambda one, all_: (similarity(one, all_) or 0.0) >= SAME_STREET)  # type: ignore[arg-type]


def _vehicle(coded: VehicleRecord, read: VehicleRecord | None) -> Iterator[Compared]:
    def of(name: str) -> Any:
        return None if read is None else getattr(read, name)

    yield Compared("in transport", None if read is None else read.in_transport == coded.in_transport)
    known = read is not None and (read.body_type_code is not None or not read.make_model)
    yield from _field("body", coded.vehicle_class, of("vehicle_class") if known else None)
    yield from _field("make and model", coded.make_model, of("make_model"), _same_make)
    yield from _field("model year", coded.model_year, of("model_year"))
    if coded.in_transport:
        yield from _field("movement", coded.movement, of("movement"))
        yield from _field("travel speed", coded.travel_speed_mps, of("travel_speed_mps"), _same_speed)
    yield from _field("speed limit", coded.speed_limit_mps, of("speed_limit_mps"), _same_speed)
    yield from _field("lanes", coded.lanes, of("lanes"))
    yield from _field("area of impact", coded.initial_impact_code, of("initial_impact_code"), _overlap)
    for name, element in _OF_VEHICLE.items():
        yield from _field(name.removesuffix("_code"), getattr(coded, name), of(name), _same_meaning(element))


def _person(coded: NonMotorist, read: NonMotorist | None) -> Iterator[Compared]:
    yield Compared("kind of person", None if read is None else read.kind is coded.kind)
    for name in ("age_years", "location_code", "actions"):
        yield from _field(
            f"person's {name.removesuffix('_code')}",
            getattr(coded, name),
            None if read is None else getattr(read, name),
        )


def _same_speed(one: float, other: float) -> bool:
    return math.isclose(one, other, abs_tol=MPS_PER_MPH)


def _same_make(one: str, other: str) -> bool:
    return set(other.casefold().split()) <= set(one.casefold().split())


def _overlap(one: int, other: int) -> bool:
    areas = impact_area(one), impact_area(other)
    if areas[0] is None or areas[1] is None:
        return one == other
    apart = abs(math.remainder(areas[0].centre_rad - areas[1].centre_rad, math.tau))
    return apart <= areas[0].half_width_rad + areas[1].half_width_rad + 1e-6


def _event(record: CrashRecord, event: Any) -> tuple[int, tuple[object, ...]]:
    persons = {person.party: f"person {n}" for n, person in enumerate(record.non_motorists, 1)}
    parties = [persons.get(each, each) for each in (event.party_1, event.party_2)]
    return event.code, tuple(sorted(map(str, parties)))


def scored(folder: Path, coded: Mapping[str, CrashRecord], model: Model, *, attempts: int) -> dict[str, Counter[str]]:
    """Count for each field in how many crashes, vehicles or persons it is right, wrong and missing."""
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for narrative in narratives_in(folder):
        if narrative.id not in coded:
            print(f"{narrative.id}: no coded report")
            continue
        try:
            reading = read_narrative(narrative.text, vocabulary(), model, attempts=attempts)
        except WrongAnswer as wrong:
            print(f"{narrative.id}: no usable answer: {wrong}")
            continue
        read = record_of(narrative, _NOWHERE, reading, vocabulary())
        if isinstance(read, str):
            print(f"{narrative.id}: {read}")
            continue
        for each in compared(coded[narrative.id], complete_record(read)):
            found[each.field]["missing" if each.right is None else "right" if each.right else "wrong"] += 1
    return found


def coded_reports(folders: Sequence[Path], keys: Collection[str]) -> dict[str, CrashRecord]:
    """Return the records of some CrashAPI reports, by key."""
    settings = CrashSettings()
    return {
        each.key: complete_record(read_report(each.path.read_bytes(), name=each.key, settings=settings))
        for each in scan(folders).reports
        if each.key in keys
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--narratives", type=Path, default=NARRATIVES)
    parser.add_argument("--coded", type=Path, nargs="*", default=list(REPORTS))
    parser.add_argument("--register", nargs=2, metavar=("NAME", "TABLE"))
    parser.add_argument("--stand-in", action="store_true")
    options = parser.parse_args()
    settings = load_settings().states
    model: Model = StandIn(options.narratives) if options.stand_in else llm_client(settings)
    if options.register:
        table = RegisterTable.open(options.register[0], Path(options.register[1]))
        prefix = f"{table.mapping.register_name}-"
        coded = {each.key.removeprefix(prefix): complete_record(each) for each in table.records()}
    else:
        coded = coded_reports(options.coded, {each.id for each in narratives_in(options.narratives)})
    found = scored(options.narratives, coded, model, attempts=settings.llm_max_attempts)
    print(f"{'field':28}{'right':>7}{'wrong':>7}{'missing':>9}{'right of those said':>22}")
    for name, counts in [*found.items(), ("all", sum(found.values(), Counter()))]:
        said = counts["right"] + counts["wrong"]
        share = f"{counts['right'] / said:.0%}" if said else ""
        print(f"{name:28}{counts['right']:7}{counts['wrong']:7}{counts['missing']:9}{share:>22}")


if __name__ == "__main__":
    main()
