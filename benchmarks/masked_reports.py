"""Hide one thing of a report, estimate the crash again, and see whether it comes back: collisions of two vehicles.

    python -m benchmarks.masked_reports ROOT [--draws 8] [--truth data/sample/truth.json] [--beside llm:coordinates-v1]

``ROOT`` holds computed crashes. Of each verified collision of two vehicles every reported speed is hidden in turn,
every reported area of impact, and the crash types of both. What was hidden is compared with the draws of the new
estimate, weighed by what the report still says: whether an interval of 80 % of the travel speed contains it, whether
the likeliest area is within a clock position of it, whether the angle between the headings is within 45 degrees of
what it was with everything reported. Chance is a speed's interval over the reported speeds of all crashes, an area as
often as it is reported, an angle as often as it comes. ``--beside`` gives the same masked reports to another estimator,
such as a configured language model that answers as the published one did. With ``--truth`` (a root of the bundled
sample) the lanes in which vehicles came are compared with the true ones, as reported and with movement, type and area
hidden together.
"""

from __future__ import annotations

import argparse
import statistics
import uuid
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.errors import Rejection
from trace_dag.flow.artefacts import MAP_REPORT, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.workspace import Workspace
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import Settings
from trace_dag.sim.sampled import SampledRuns, simulate_samples, weighted_quantiles
from trace_dag.states.analytic import NAME as ANALYTIC
from trace_dag.states.estimate import Estimator, estimator_factory
from trace_dag.states.samples import draw_samples
from trace_dag.states.scene import place_of
from trace_dag.states.types import StateEstimate
from trace_dag.studies.estimators import settings_of
from trace_dag.studies.stored_crashes import crash_files
from trace_dag.studies.truth import load_truth, score_truth
from trace_dag.units import bearing_to_clock_h, clock_difference_h, mps_to_mph

WITHIN_H, WITHIN_DEG = 1.0, 45.0


@dataclass(frozen=True)
class Crash:
    """A stored collision of two vehicles."""

    record: CrashRecord
    network: RoadNetwork
    report: MapReport
    settings: Settings
    draws: int
    estimator: Estimator
    usual: Estimator

    def whole(self) -> tuple[StateEstimate, SampledRuns] | None:
        """The crash estimated as always, from all that is reported."""
        return self._estimated(self.usual, self.record)

    def again(self, record: CrashRecord) -> tuple[StateEstimate, SampledRuns] | None:
        """The crash estimated from another record, with its draws; None where no reading lets the vehicles meet."""
        return self._estimated(self.estimator, record)

    def _estimated(self, estimator: Estimator, record: CrashRecord) -> tuple[StateEstimate, SampledRuns] | None:
        try:
            found = estimator.estimate(record, self.network, self.report)
        except Rejection:
            return None  # UnusableAnswers of a language model among them
        drawn = replace(found, samples=draw_samples(record, found.hypotheses, self.draws))
        place = place_of(self.report.placement)
        return drawn, simulate_samples(self.network, drawn, (), self.settings.sim, record, place)


def collisions(root: str, draws: int, estimator: str) -> Iterator[Crash]:
    """The verified collisions of a root, to be estimated by an estimator: ``analytic``, ``llm:PROMPT@MODEL``, ..."""
    workspace = Workspace.open(root)
    usual, asked = (_estimator(workspace, name) for name in (ANALYTIC, estimator))
    asked.require()
    keys = [key for cohort in workspace.registry.cohorts().values() for key in cohort.reports]
    for files in crash_files(workspace, keys):
        if _verified(files):
            record = files.load(RECORD)
            if reconstruction_of(record) is Reconstruction.COLLISION:
                yield Crash(
                    record, files.load(ROAD_MAP), files.load(MAP_REPORT), workspace.settings, draws, asked, usual
                )


def _estimator(workspace: Workspace, name: str) -> Estimator:
    states = settings_of(name, workspace.settings.states)
    return estimator_factory(states)(states, files=workspace.storage, ledger=f"masked-{uuid.uuid4().hex}")


def _verified(files: CrashFiles) -> bool:
    return files.has(VERDICT) and files.load(VERDICT).accepted


def with_vehicle(record: CrashRecord, vehicle: VehicleRecord) -> CrashRecord:
    """A record with another vehicle of that number."""
    vehicles = tuple(vehicle if each.number == vehicle.number else each for each in record.vehicles)
    return replace(record, vehicles=vehicles)


def without_area(record: CrashRecord, number: int) -> CrashRecord:
    """A record in which nothing says where a vehicle was struck."""
    events = tuple(
        replace(
            event,
            area_1=None if event.party_1 == number else event.area_1,
            area_2=None if event.party_2 == number else event.area_2,
        )
        for event in record.events
    )
    vehicle = next(each for each in record.vehicles if each.number == number)
    hidden = replace(vehicle, impact=None, initial_impact_code=None, damaged_areas=())
    return with_vehicle(replace(record, events=events), hidden)


def without_types(record: CrashRecord) -> CrashRecord:
    """A record without crash types."""
    return replace(record, vehicles=tuple(replace(each, crash_type_code=None) for each in record.vehicles))


def speed_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, tuple[float, ...] | None]]:
    """Hidden travel speed, and low, middle and high of the draws, None where there are none; mph."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.travel_speed_mps is None:
                continue
            found = crash.again(with_vehicle(crash.record, replace(vehicle, travel_speed_mps=None)))
            hidden = mps_to_mph(vehicle.travel_speed_mps)
            if found is None or not found[1].contacts:
                yield hidden, None
                continue
            states, runs = found
            travelled = [
                (draw.travel_mps, contact.weight)
                for contact in runs.contacts
                for draw in states.samples[contact.sample].parties
                if draw.number == vehicle.number
            ]
            yield hidden, tuple(mps_to_mph(each) for each in weighted_quantiles(travelled, (0.1, 0.5, 0.9)))


def area_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, float | None]]:
    """Hidden clock position, and the likeliest of the draws; None where there is none."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.impact is None:
                continue
            found = crash.again(without_area(crash.record, vehicle.number))
            likely: defaultdict[float, float] = defaultdict(float)
            for contact in found[1].contacts if found else ():
                for party in contact.parties:
                    if party.number == vehicle.number:
                        likely[round(bearing_to_clock_h(party.bearing_rad)) % 12 or 12] += contact.weight
            yield vehicle.impact.clock_h, max(likely, key=likely.__getitem__, default=None)


def angle_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, float | None]]:
    """The angle between the headings with everything reported, and without the crash types."""
    for crash in crashes:
        reported, hidden = crash.whole(), crash.again(without_types(crash.record))
        whole = _angle_deg(reported[1]) if reported else None
        if whole is not None:
            yield whole, _angle_deg(hidden[1]) if hidden else None


def _angle_deg(runs: SampledRuns) -> float | None:
    angles = [(each.angle_deg, each.weight) for each in runs.contacts if each.angle_deg is not None]
    return weighted_quantiles(angles, (0.5,))[0] if angles else None


def lanes(root: str, truth: Path) -> Iterator[tuple[str, float, float]]:
    """What was hidden, the share of sample crashes whose lanes are right, and the share by chance."""
    crashes = list(collisions(root, 0, ANALYTIC))
    true = load_truth(truth)
    keys = {crash.record.key for crash in crashes}
    of_these = true.model_copy(update={"crashes": tuple(each for each in true.crashes if each.key in keys)})
    chance = [1 / max(vehicle.approach.lanes, 1) for crash in of_these.crashes for vehicle in crash.vehicles]
    for what, hide in (("nothing", lambda record: record), ("movement, type and area", _hidden)):
        estimates = {}
        for crash in crashes:
            found = crash.again(hide(crash.record))
            if found is not None:
                estimates[crash.record.key] = found[0]
        right = [row.lane_correct is True for row in score_truth(of_these, estimates).rows]
        yield what, sum(right) / len(right), sum(chance) / len(chance)


def _hidden(record: CrashRecord) -> CrashRecord:
    for vehicle in record.vehicles:
        record = without_area(record, vehicle.number)
    vehicles = tuple(replace(each, movement=PreCrashMovement.UNKNOWN) for each in without_types(record).vehicles)
    return replace(record, vehicles=vehicles)


def print_recovered(by_estimator: Mapping[str, Sequence[Crash]]) -> None:
    """The table: a column for each estimator, and one for chance."""
    columns = {name: _recovered(crashes) for name, crashes in by_estimator.items()}
    print(f"{'hidden':24}{'number':>8}" + "".join(f"{name:>26}" for name in columns) + f"{'by chance':>12}")
    for row in zip(*columns.values(), strict=True):
        first = row[0]
        shares = "".join(f"{f'{100 * each.share:.0f} %{each.detail}':>26}" for each in row)
        print(f"{first.hidden:24}{first.number:8}{shares}{first.chance:>12}")


class _Recovered(NamedTuple):
    """What came back of one kind of thing that was hidden."""

    hidden: str
    number: int
    share: float
    detail: str
    chance: str


def _recovered(crashes: Sequence[Crash]) -> list[_Recovered]:
    return [_speeds_recovered(crashes), _areas_recovered(crashes), _angles_recovered(crashes)]


def _speeds_recovered(crashes: Sequence[Crash]) -> _Recovered:
    rows = list(speed_rows(crashes))
    within = [found is not None and found[0] - 0.5 <= hidden <= found[2] + 0.5 for hidden, found in rows]
    low, high = weighted_quantiles([(hidden, 1.0) for hidden, _ in rows], (0.1, 0.9))
    widths = [found[2] - found[0] for _, found in rows if found is not None]
    detail = f" ({statistics.median(widths):.0f} mph wide)" if widths else ""
    return _Recovered("travel speed, in 80 %", len(rows), _share(within), detail, f"80 % ({high - low:.0f})")


def _areas_recovered(crashes: Sequence[Crash]) -> _Recovered:
    rows = list(area_rows(crashes))
    found = [each is not None and abs(clock_difference_h(each, hidden)) <= WITHIN_H for hidden, each in rows]
    often = Counter(hidden for hidden, _ in rows)
    near = [(one, two) for one in often for two in often if abs(clock_difference_h(one, two)) <= WITHIN_H]
    chance = sum(often[one] * often[two] for one, two in near) / len(rows) ** 2
    return _Recovered("area of impact", len(rows), _share(found), "", f"{100 * chance:.0f} %")


def _angles_recovered(crashes: Sequence[Crash]) -> _Recovered:
    rows = list(angle_rows(crashes))
    found = [each is not None and abs(each - whole) <= WITHIN_DEG for whole, each in rows]
    chance = sum(abs(one - two) <= WITHIN_DEG for one, _ in rows for two, _ in rows) / len(rows) ** 2
    return _Recovered("crash types (angle)", len(rows), _share(found), "", f"{100 * chance:.0f} %")


def _share(held: Sequence[bool]) -> float:
    return sum(held) / len(held)


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("root", help="a root with computed crashes")
    arguments.add_argument("--draws", type=int, default=8, help="of each estimate (default 8)")
    arguments.add_argument("--truth", type=Path, help="truth.json of the sample, if the root holds it")
    arguments.add_argument("--beside", action="append", default=[], help="another estimator; may be given again")
    options = arguments.parse_args()
    names = [ANALYTIC, *options.beside]
    print_recovered({name: list(collisions(options.root, options.draws, name)) for name in names})
    if options.truth:
        for what, share, chance in lanes(options.root, options.truth):
            print(f"lanes, hidden {what}: {100 * share:.0f} % of the vehicles, by chance {100 * chance:.0f} %")


if __name__ == "__main__":
    main()
