"""Measure of how well the estimator finds a fact of a report that was hidden from it, in collisions of two vehicles.

    python -m lab masked_reports                    all of it
    python -m lab masked_reports ROOT [--draws 8] [--truth data/sample/truth.json] [--beside llm:coordinates-v1]

``ROOT`` holds computed crashes. The first command computes the shared crashes and those of the sample; the environment
variable ``TRACE_DAG_MASKED_ROOT`` names a root in which the shared ones are computed already.

In each verified collision of two vehicles one fact after the other is hidden, and the crash is estimated again. The
draws of that estimate, weighed by the rest of the report, are compared with the hidden fact:

* a reported travel speed: whether the median of the draws is within 5 mph of it, and whether their 80 % interval
  contains it;
* an area of impact: whether the likeliest is within a clock position of it;
* the movement of a vehicle before the crash (P_CRASH1), alone and with both crash types: whether the likeliest
  manoeuvre is of its kind;
* both crash types: whether the angle between the headings is within 45 degrees of the one with the full report;
* everything that says something about lanes, of both vehicles: whether each comes in the lane that it has with the
  full report. That lane is an estimate too; the true lanes of the sample are known.

For comparison, chance draws each of these from all crashes: another vehicle's speed, area, movement or angle, or any
lane of the same direction. If a language model is configured (``TRACE_DAG_STATES__LLM_MODEL``), it is asked for
coordinates about the same masked reports, as in the published study.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from lab.cohorts import SAMPLE
from lab.masking import (
    Crash,
    collisions,
    compute_sample,
    compute_shared,
    with_vehicle,
    without_area,
    without_lanes,
    without_movement,
    without_types,
)
from lab.measuring import SHARED, Figure
from lab.truth.vehicles import SampleTruth, load_truth, score_truth
from trace_dag.common.geometry import Pose
from trace_dag.common.units import bearing_to_clock_h, clock_difference_h, mps_to_mph, wrap_angle
from trace_dag.crash.record import PreCrashMovement
from trace_dag.reconstruction.analytic_hypotheses import NAME as ANALYTIC
from trace_dag.reconstruction.samples.simulated import SampledRuns, compute_weighted_quantiles
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import Manoeuvre, ParticipantState, StateEstimate

WITHIN_MPH, WITHIN_H, WITHIN_DEG = 5.0, 1.0, 45.0
DRAWS: Final = 8
_PUBLISHED_KIND: Final = "llm:coordinates-v1"
_ALONG, _LEFT, _RIGHT, _CHANGES = "along", "left", "right", "to another lane"
_REPORTED: Final[Mapping[PreCrashMovement, str]] = {
    PreCrashMovement.GOING_STRAIGHT: _ALONG,
    PreCrashMovement.DECELERATING: _ALONG,
    PreCrashMovement.ACCELERATING: _ALONG,
    PreCrashMovement.NEGOTIATING_CURVE: _ALONG,
    PreCrashMovement.STARTING: "starting",
    PreCrashMovement.STOPPED: "standing",
    PreCrashMovement.TURNING_LEFT: _LEFT,
    PreCrashMovement.TURNING_RIGHT: _RIGHT,
    PreCrashMovement.U_TURN: "back",
    PreCrashMovement.BACKING: "backing",
    PreCrashMovement.CHANGING_LANES: _CHANGES,
    PreCrashMovement.MERGING: _CHANGES,
    PreCrashMovement.PASSING: _CHANGES,
}
"""Kinds of movements; what is not here says nothing of the course (avoiding, parking, other)."""
_ESTIMATED: Final[Mapping[Manoeuvre, str]] = {
    Manoeuvre.STRAIGHT: _ALONG,
    Manoeuvre.CURVE: _ALONG,
    Manoeuvre.CROSS_CENTRELINE: _ALONG,
    Manoeuvre.WRONG_WAY: _ALONG,
    Manoeuvre.LEAVE_ROAD: _ALONG,
    Manoeuvre.STARTING: "starting",
    Manoeuvre.STOPPED: "standing",
    Manoeuvre.TURN_LEFT: _LEFT,
    Manoeuvre.TURN_RIGHT: _RIGHT,
    Manoeuvre.U_TURN: "back",
    Manoeuvre.BACKING: "backing",
    Manoeuvre.LANE_CHANGE_LEFT: _CHANGES,
    Manoeuvre.LANE_CHANGE_RIGHT: _CHANGES,
    Manoeuvre.MERGE: _CHANGES,
    Manoeuvre.PASS: _CHANGES,
}
Crashes = Sequence[Crash]
Value = TypeVar("Value")
Found = tuple[StateEstimate, SampledRuns]


def measure(runs: int) -> Iterator[Figure]:
    """Yield all rows as figures; nothing here is random, so that one run is enough.

    Without shared crashes the lanes of the sample alone.
    """
    with tempfile.TemporaryDirectory() as folder:
        if (SHARED / "fars-csv").is_dir():
            root = os.environ.get("TRACE_DAG_MASKED_ROOT")
            if root is None:
                root = str(Path(folder) / "shared")
                compute_shared(Path(root))
            yield from recovered(by_estimator(root, DRAWS, _configured()))
        sample = Path(folder) / "sample"
        compute_sample(sample)
        yield from lanes(by_estimator(str(sample), 0, _configured()), load_truth(SAMPLE / "truth.json"))


def _configured() -> list[str]:
    return [_PUBLISHED_KIND] if "TRACE_DAG_STATES__LLM_MODEL" in os.environ else []


def by_estimator(root: str, draws: int, beside: Iterable[str]) -> dict[str, Crashes]:
    """Return the crashes of a root for the analytic estimator, and for others that are asked about the same."""
    return {name: list(collisions(root, draws, name)) for name in (ANALYTIC, *beside)}


def recovered(crashes: Mapping[str, Crashes]) -> Iterator[Figure]:
    """Yield the rows of the table, as they are measured."""
    speeds = {name: list(speed_rows(each)) for name, each in crashes.items()}
    ours = speeds[ANALYTIC]
    hidden = [row[0] for row in ours]
    yield _figure(
        f"travel speed, within {WITHIN_MPH:g} mph",
        {name: [found is not None and abs(found[1] - true) <= WITHIN_MPH for true, found in rows]
         for name, rows in speeds.items()},
        _pairs(hidden, lambda one, two: abs(one - two) <= WITHIN_MPH),
    )  # fmt: skip
    low, high = compute_weighted_quantiles([(true, 1.0) for true in hidden], (0.1, 0.9))
    wide = statistics.median(found[2] - found[0] for _, found in ours if found is not None)
    yield _figure(
        "travel speed, in the interval of 80 %",
        {name: [found is not None and found[0] - 0.5 <= true <= found[2] + 0.5 for true, found in rows]
         for name, rows in speeds.items()},
        0.8,
        f"intervals {wide:.0f} mph wide in the median; by chance {high - low:.0f}, of all reported speeds",
    )  # fmt: skip
    areas = {name: list(area_rows(each)) for name, each in crashes.items()}
    yield _figure(
        "area of impact, within a clock position",
        {name: [found is not None and _near_h(found, true) for true, found in rows] for name, rows in areas.items()},
        _pairs([true for true, _ in areas[ANALYTIC]], _near_h),
    )
    for what, with_types in (("manoeuvre", False), ("manoeuvre, hidden with both crash types", True)):
        moves = {name: list(movement_rows(each, with_types)) for name, each in crashes.items()}
        yield _figure(
            what,
            {name: [found == true for true, found in rows] for name, rows in moves.items()},
            _pairs([true for true, _ in moves[ANALYTIC]], str.__eq__),
            f"{100 * sum(true == _ALONG for true, _ in moves[ANALYTIC]) / len(moves[ANALYTIC]):.0f} % go along",
        )
    angles = {name: list(angle_rows(each)) for name, each in crashes.items()}
    yield _figure(
        f"both crash types: angle between the headings, within {WITHIN_DEG:g} degrees",
        {name: [found is not None and _near_deg(found, whole) for whole, found in rows]
         for name, rows in angles.items()},
        _pairs([whole for whole, _ in angles[ANALYTIC]], _near_deg),
    )  # fmt: skip
    kept = {name: list(lane_rows(each)) for name, each in crashes.items()}
    yield _figure(
        "lanes, hidden with all that tells them: the lane of the whole report",
        {name: [same for same, _ in rows] for name, rows in kept.items()},
        statistics.fmean(1 / count for _, count in kept[ANALYTIC]),
    )


def lanes(crashes: Mapping[str, Crashes], true: SampleTruth) -> Iterator[Figure]:
    """Return the share of the sample's vehicles in their true lanes, with everything reported and with lanes hidden."""
    keys = {crash.record.key for crash in crashes[ANALYTIC]}
    of_these = true.model_copy(update={"crashes": tuple(each for each in true.crashes if each.key in keys)})
    chance = [1 / max(vehicle.approach.lanes, 1) for crash in of_these.crashes for vehicle in crash.vehicles]
    for what, hide in (("nothing hidden", lambda record: record), ("hidden with all that tells them", without_lanes)):
        right: dict[str, list[bool]] = {}
        for name, each in crashes.items():
            found = {crash.record.key: crash.again(hide(crash.record)) for crash in each}
            estimates = {key: states[0] for key, states in found.items() if states is not None}
            right[name] = [row.lane_correct is True for row in score_truth(of_these, estimates).rows]
        yield _figure(f"lanes of the sample, {what}: the true lane", right, statistics.fmean(chance))


def _figure(what: str, held: Mapping[str, Sequence[bool]], chance: float, note: str = "") -> Figure:
    shares = {name: 100 * statistics.fmean(each) for name, each in held.items()}
    return Figure(
        what,
        shares[ANALYTIC],
        "%",
        "by chance",
        100 * chance,
        note=note,
        hidden=len(held[ANALYTIC]),
        asked={name: share for name, share in shares.items() if name != ANALYTIC},
    )


def _pairs(values: Sequence[Value], alike: Callable[[Value, Value], bool]) -> float:
    """Return the share of right answers if each were another crash's, drawn from all."""
    often = Counter(values)
    return sum(often[one] * often[two] for one in often for two in often if alike(one, two)) / len(values) ** 2


def _near_h(one: float, two: float) -> bool:
    return abs(clock_difference_h(one, two)) <= WITHIN_H


def _near_deg(one: float, two: float) -> bool:
    return abs(one - two) <= WITHIN_DEG


# --- what was hidden, and what came back -----------------------------------------------------------------------------
def speed_rows(crashes: Crashes) -> Iterator[tuple[float, tuple[float, ...] | None]]:
    """Yield the hidden travel speed, and low, middle and high of the draws, None where there are none; mph."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.travel_speed_mps is None:
                continue
            found = crash.again(with_vehicle(crash.record, replace(vehicle, travel_speed_mps=None)))
            hidden = mps_to_mph(vehicle.travel_speed_mps)
            if found is None or not found[1].contacts:
                yield hidden, None
                continue
            states, drawn = found
            travelled = [
                (draw.travel_mps, contact.weight)
                for contact in drawn.contacts
                for draw in states.samples[contact.sample].parties
                if draw.number == vehicle.number
            ]
            yield hidden, tuple(mps_to_mph(each) for each in compute_weighted_quantiles(travelled, (0.1, 0.5, 0.9)))


def area_rows(crashes: Crashes) -> Iterator[tuple[float, float | None]]:
    """Yield the hidden clock position, and the likeliest of the draws; None where there is none."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.impact is None:
                continue
            found = crash.again(without_area(crash.record, vehicle.number))
            yield (
                vehicle.impact.clock_h,
                _likeliest(
                    (round(bearing_to_clock_h(party.bearing_rad)) % 12 or 12, contact.weight)
                    for contact in (found[1].contacts if found else ())
                    for party in contact.parties
                    if party.number == vehicle.number
                ),
            )


def movement_rows(crashes: Crashes, with_types: bool) -> Iterator[tuple[str, str | None]]:
    """Yield the hidden kind of movement, and the likeliest of the draws; None where there is none."""
    for crash in crashes:
        for vehicle in crash.record.vehicles:
            if vehicle.movement not in _REPORTED:
                continue
            hidden = without_movement(crash.record, vehicle.number)
            found = crash.again(without_types(hidden) if with_types else hidden)
            yield (
                _REPORTED[vehicle.movement],
                _likeliest(
                    (_ESTIMATED.get(party.manoeuvre, party.manoeuvre.value), weight)
                    for party, weight in (_drawn(found, vehicle.number) if found else ())
                ),
            )


def _drawn(found: Found, number: int) -> Iterator[tuple[ParticipantState, float]]:
    """Yield a party as the hypothesis of each draw has it, with the draw's weight."""
    states, drawn = found
    for contact in drawn.contacts:
        hypothesis = states.hypotheses[states.samples[contact.sample].hypothesis]
        yield from ((each, contact.weight) for each in hypothesis.participants if each.vehicle_number == number)


def _likeliest(weighed: Iterable[tuple[Value, float]]) -> Value | None:
    together: defaultdict[Value, float] = defaultdict(float)
    for value, weight in weighed:
        together[value] += weight
    return max(together, key=together.__getitem__, default=None)


def angle_rows(crashes: Crashes) -> Iterator[tuple[float, float | None]]:
    """Yield the angle between the headings with everything reported, and without the crash types."""
    for crash in crashes:
        whole = _angle_deg(crash.whole[1]) if crash.whole else None
        if whole is not None:
            hidden = crash.again(without_types(crash.record))
            yield whole, _angle_deg(hidden[1]) if hidden else None


def _angle_deg(drawn: SampledRuns) -> float | None:
    angles = [(each.angle_deg, each.weight) for each in drawn.contacts if each.angle_deg is not None]
    return compute_weighted_quantiles(angles, (0.5,))[0] if angles else None


def lane_rows(crashes: Crashes) -> Iterator[tuple[bool, int]]:
    """Return, for each vehicle, whether the draws without lanes mostly come in the lane of the best estimate with
    everything reported, and the number of lanes of its road that way.
    """
    for crash in crashes:
        if crash.whole is None:
            continue
        found = crash.again(without_lanes(crash.record))
        for party in crash.whole[0].best.participants:
            if party.initial_lane is None:
                continue
            lane = party.initial_lane.lane
            width_m = crash.network.width_m(lane, party.initial_lane.s_m)
            drawn = _drawn(found, party.vehicle_number) if found else ()
            same = _likeliest((came_in_same_lane(party, each, width_m), weight) for each, weight in drawn)
            yield same is True, _lanes_that_way(crash.network, party)


def _lanes_that_way(network: RoadNetwork, party: ParticipantState) -> int:
    assert party.initial_lane is not None
    own = party.initial_lane.lane
    road = network.road_by_id[own.road_id]
    ways = [ref for ref in network.drivable_lanes_of(road) if ref.section == own.section]
    return sum(network.direction(ref) == network.direction(own) for ref in ways)


def came_in_same_lane(one: ParticipantState, two: ParticipantState, width_m: float) -> bool:
    """Return whether two motions to an impact came along one lane: where the one that began nearer to it began, the
    other was less than half a lane's width to the side, and headed the same way.
    """
    far, near = (one, two) if _length_m(one) >= _length_m(two) else (two, one)
    path, place = far.trajectory, near.initial_pose
    away_m = np.hypot(path.x_m - place.x_m, path.y_m - place.y_m)
    k = int(away_m.argmin())
    there = Pose(float(path.x_m[k]), float(path.y_m[k]), float(path.heading_rad[k]))
    left_m = (place.y_m - there.y_m) * math.cos(there.heading_rad) - (place.x_m - there.x_m) * math.sin(
        there.heading_rad
    )
    turned = abs(wrap_angle(place.heading_rad - there.heading_rad))
    return abs(left_m) <= width_m / 2 and turned < math.radians(WITHIN_DEG)


def _length_m(party: ParticipantState) -> float:
    """Return the distance from its beginning to the impact."""
    return math.dist((party.initial_pose.x_m, party.initial_pose.y_m), (party.impact_pose.x_m, party.impact_pose.y_m))


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("root", help="a root with computed crashes")
    arguments.add_argument("--draws", type=int, default=DRAWS, help="of each estimate (default 8)")
    arguments.add_argument("--truth", type=Path, help="truth.json of the sample, if the root holds it")
    arguments.add_argument("--beside", action="append", default=[], help="another estimator; may be given again")
    options = arguments.parse_args()
    crashes = by_estimator(options.root, options.draws, options.beside)
    print(f"{'hidden':72}{'number':>8}{'recovered':>11}{'by chance':>11}" + "".join(f"{n:>26}" for n in options.beside))
    rows = [recovered(crashes)] + ([lanes(crashes, load_truth(options.truth))] if options.truth else [])
    for figure in (each for table in rows for each in table):
        asked = "".join(f"{share:24.0f} %" for share in figure.asked.values())
        note = f"  ({figure.note})" if figure.note else ""
        print(
            f"{figure.name:72}{figure.hidden:8}{figure.value:9.0f} %{figure.peer_value:9.0f} %{asked}{note}", flush=True
        )


if __name__ == "__main__":
    main()
