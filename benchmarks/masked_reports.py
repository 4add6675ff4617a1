"""Hide one thing of a report, estimate the crash again, and see whether it comes back: collisions of two vehicles.

    python -m benchmarks.masked_reports ROOT [--draws 8] [--truth data/sample/truth.json]

``ROOT`` holds computed crashes. Of each verified collision of two vehicles every reported speed is hidden in turn,
every reported area of impact, and the crash types of both. What was hidden is compared with the draws of the new
estimate, weighed by what the report still says: whether an interval of 80 % of the travel speed contains it, whether
the likeliest area is within a clock position of it, whether the angle between the headings is within 45 degrees of
what it was with everything reported. Chance is a speed's interval over the reported speeds of all crashes, an area as
often as it is reported, an angle as often as it comes. With ``--truth`` (a root of the bundled sample) the lanes in
which vehicles came are compared with the true ones, as reported and with movement, type and area hidden together.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

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
from trace_dag.states.analytic import estimate_analytic
from trace_dag.states.samples import draw_samples
from trace_dag.states.scene import place_of
from trace_dag.states.types import StateEstimate
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

    def again(self, record: CrashRecord) -> tuple[StateEstimate, SampledRuns] | None:
        """The crash estimated from another record, with its draws; None where no reading lets the vehicles meet."""
        try:
            found = estimate_analytic(record, self.network, self.report, self.settings.states)
        except Rejection:
            return None
        drawn = replace(found, samples=draw_samples(record, found.hypotheses, self.draws))
        place = place_of(self.report.placement)
        return drawn, simulate_samples(self.network, drawn, (), self.settings.sim, record, place)


def collisions(root: str, draws: int) -> Iterator[Crash]:
    """The verified collisions of a root."""
    workspace = Workspace.open(root)
    keys = [key for cohort in workspace.registry.cohorts().values() for key in cohort.reports]
    for files in crash_files(workspace, keys):
        if _verified(files):
            record = files.load(RECORD)
            if reconstruction_of(record) is Reconstruction.COLLISION:
                yield Crash(record, files.load(ROAD_MAP), files.load(MAP_REPORT), workspace.settings, draws)


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


def speed_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, float, float, float]]:
    """Hidden travel speed, and low, middle and high of the draws; mph."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.travel_speed_mps is None:
                continue
            found = crash.again(with_vehicle(crash.record, replace(vehicle, travel_speed_mps=None)))
            if found is None or not found[1].contacts:
                continue
            states, runs = found
            travelled = [
                (draw.travel_mps, contact.weight)
                for contact in runs.contacts
                for draw in states.samples[contact.sample].parties
                if draw.number == vehicle.number
            ]
            low, middle, high = (mps_to_mph(each) for each in weighted_quantiles(travelled, (0.1, 0.5, 0.9)))
            yield mps_to_mph(vehicle.travel_speed_mps), low, middle, high


def area_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, float | None]]:
    """Hidden clock position, and the likeliest of the draws; None where there is none."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.impact is None:
                continue
            found = crash.again(without_area(crash.record, vehicle.number))
            likely: Counter[float] = Counter()
            for contact in found[1].contacts if found else ():
                for party in contact.parties:
                    if party.number == vehicle.number:
                        likely[round(bearing_to_clock_h(party.bearing_rad)) % 12 or 12] += contact.weight
            yield vehicle.impact.clock_h, likely.most_common(1)[0][0] if likely else None


def angle_rows(crashes: Sequence[Crash]) -> Iterator[tuple[float, float | None]]:
    """The angle between the headings with everything reported, and without the crash types."""
    for crash in crashes:
        reported, hidden = crash.again(crash.record), crash.again(without_types(crash.record))
        whole = _angle_deg(reported[1]) if reported else None
        if whole is not None:
            yield whole, _angle_deg(hidden[1]) if hidden else None


def _angle_deg(runs: SampledRuns) -> float | None:
    angles = [(each.angle_deg, each.weight) for each in runs.contacts if each.angle_deg is not None]
    return weighted_quantiles(angles, (0.5,))[0] if angles else None


def lanes(root: str, truth: Path) -> Iterator[tuple[str, float, float]]:
    """What was hidden, the share of sample crashes whose lanes are right, and the share by chance."""
    crashes = list(collisions(root, 0))
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


def print_recovered(crashes: Sequence[Crash]) -> None:
    """The table."""
    speeds = list(speed_rows(crashes))
    within = [low - 0.5 <= hidden <= high + 0.5 for hidden, low, _, high in speeds]
    everywhere = [(hidden, 1.0) for hidden, *_ in speeds]
    low, high = weighted_quantiles(everywhere, (0.1, 0.9))
    print(f"{'hidden':24}{'number':>8}{'recovered':>12}{'by chance':>12}")
    print(f"{'travel speed, in 80 %':24}{len(speeds):8}{_percent(within):>12}{'80 %':>12}", end="  ")
    widths = sorted(high - low for _, low, _, high in speeds)
    print(f"interval {widths[len(widths) // 2]:.0f} mph wide, by chance {high - low:.0f}")
    areas = list(area_rows(crashes))
    found = [each is not None and abs(clock_difference_h(each, hidden)) <= WITHIN_H for hidden, each in areas]
    often = Counter(hidden for hidden, _ in areas)
    chance = (
        sum(often[one] * often[two] for one in often for two in often if abs(clock_difference_h(one, two)) <= WITHIN_H)
        / len(areas) ** 2
    )
    print(f"{'area of impact':24}{len(areas):8}{_percent(found):>12}{100 * chance:10.0f} %")
    angles = list(angle_rows(crashes))
    found = [each is not None and abs(each - whole) <= WITHIN_DEG for whole, each in angles]
    chance = sum(abs(one - two) <= WITHIN_DEG for one, _ in angles for two, _ in angles) / len(angles) ** 2
    print(f"{'crash types (angle)':24}{len(angles):8}{_percent(found):>12}{100 * chance:10.0f} %")


def _percent(held: Sequence[bool]) -> str:
    return f"{100 * sum(held) / len(held):.0f} %"


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("root", help="a root with computed crashes")
    arguments.add_argument("--draws", type=int, default=8, help="of each estimate (default 8)")
    arguments.add_argument("--truth", type=Path, help="truth.json of the sample, if the root holds it")
    options = arguments.parse_args()
    print_recovered(list(collisions(options.root, options.draws)))
    if options.truth:
        for what, share, chance in lanes(options.root, options.truth):
            print(f"lanes, hidden {what}: {100 * share:.0f} % of the vehicles, by chance {100 * chance:.0f} %")


if __name__ == "__main__":
    main()
