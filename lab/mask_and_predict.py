"""Hide what reports say and recorders measured, estimate it, compare: how good the estimates are, and how sure.

    python -m lab mask_and_predict --fars DIR ... --recorders cases.json [--reports DIR ...]

Every reported travel speed is hidden in turn and estimated with tables fitted to the crashes of the other nine tenths
(:mod:`lab.fit_speeds`); so is every recorder's speed at the impact. Beside it stands the program's rule, which
gives one speed. An interval of 80 % ought to contain 80 % of what was hidden.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import Final
from unittest.mock import patch

from lab.fit_speeds import (
    Recorded,
    Reported,
    asked_speeds,
    fit_braking,
    fit_shifts,
    fit_spread,
    masked,
    party_of,
    read_reports,
    recorded_speeds,
)
from lab.measuring import SHARED, Figure
from trace_dag.common.units import mps_to_mph
from trace_dag.reconstruction.motion import speed_prior
from trace_dag.reconstruction.motion.speed_prior import (
    Distribution,
    speed_class,
    speed_kept_distribution,
    speed_profile,
    travel_speed_distribution,
)
from trace_dag.reconstruction.motion.speeds import STOP_CONTROLS, travel_speed

FOLDS: Final = 10
NEAR_MPH: Final = 5.0
_LOW, _HIGH = 0.1, 0.9
_STEPS: Final = 40


@dataclass(frozen=True)
class Guess:
    """One hidden speed (mph), the rule's value, and the estimate with its interval of 80 %."""

    group: str
    hidden: float
    rule: float
    estimate: float
    low: float
    high: float


def reported_guesses(rows: Sequence[Reported]) -> Iterator[Guess]:
    """Yield the travel speeds of reports, each by what the other crashes taught."""
    for fold in range(FOLDS):
        shifts = fit_shifts(kept := [row for row in rows if _fold(row.party.record.key) != fold])
        spread = fit_spread(kept, shifts)
        with patch.object(speed_prior, "SHIFTS_MPH", shifts), patch.object(speed_prior, "SPREAD_MPH", spread):
            for row in rows:
                if _fold(row.party.record.key) == fold:
                    found = travel_speed_distribution(row.party, row.rule)
                    group = speed_class(row.party, row.rule).value
                    yield _guess(group, row.speed_mps, row.rule.speed_mps, found)


def recorded_guesses(rows: Sequence[Recorded]) -> Iterator[Guess]:
    """Yield speeds at the impact of recorders: travel speeds as reports taught, braking as other recorders did."""
    for fold in range(FOLDS):
        braking = fit_braking([row for row in rows if _fold(row.case) != fold])
        with patch.object(speed_prior, "BRAKING", braking):
            for row in rows:
                if _fold(row.case) != fold or row.vehicle.speed_limit_mps is None:
                    continue
                own = party_of(row.vehicle)
                stop = row.vehicle.traffic_control_code in STOP_CONTROLS
                rule = travel_speed(row.vehicle, own.crash_type, own.turn, None, crossing=stop)
                travel, kept = travel_speed_distribution(own, rule), speed_kept_distribution(own)
                by_rule = speed_profile(own, rule.speed_mps).impact_mps
                yield _guess(speed_prior.role(own).value, row.impact_mps, by_rule, _product(travel, kept))


def _product(one: Distribution, two: Distribution) -> Distribution:
    steps = [(k + 0.5) / _STEPS for k in range(_STEPS)]
    return Distribution(speed_prior.quantiles([one.at(p) * two.at(q) for p in steps for q in steps]))


def _guess(group: str, hidden_mps: float, rule_mps: float, found: Distribution) -> Guess:
    values = (hidden_mps, rule_mps, found.median, found.at(_LOW), found.at(_HIGH))
    return Guess(group, *(mps_to_mph(value) for value in values))


def _fold(key: str) -> int:
    return zlib.crc32(key.encode()) % FOLDS


def print_guesses(title: str, guesses: Sequence[Guess]) -> None:
    """Print a table by group: errors of rule and estimate (mph), and the share of hidden speeds within the
    intervals."""
    print(f"\n{title}")
    print(f"{'':16}{'number':>8}{'rule':>8}{'(mean)':>8}{'learned':>9}{'(mean)':>8}{'within 80 %':>13}{'width':>8}")
    groups = sorted({each.group for each in guesses})
    for name in [*groups, "all"]:
        of_group = [each for each in guesses if name in (each.group, "all")]
        rule = [abs(each.rule - each.hidden) for each in of_group]
        learned = [abs(each.estimate - each.hidden) for each in of_group]
        width = median(each.high - each.low for each in of_group)
        print(
            f"{name:16}{len(of_group):8}{median(rule):8.1f}{sum(rule) / len(rule):8.1f}{median(learned):9.1f}"
            f"{sum(learned) / len(learned):8.1f}{100 * _within(of_group):12.0f}%{width:8.0f}"
        )


def measure(runs: int) -> Iterator[Figure]:
    """Yield both tables as figures, of the shared data; nothing here is random, so that one run is enough."""
    rows = list(masked(read_reports([SHARED / "fars-csv"], [SHARED / "va-2023/reports"])))
    recorded = recorded_speeds(SHARED / "ciren/cases.json")
    for what, guesses in (
        ("masked travel speeds", list(reported_guesses(rows))),
        ("masked speeds at the impact", list(recorded_guesses(recorded))),
    ):
        errors, of_rule = ([abs(found - hidden) for hidden, found in pairs] for pairs in _pairs(guesses))
        yield Figure(
            f"{what}: median error", median(errors), "mph", "the rule", median(of_rule), 0.8, goal_of_ratio=True
        )
        yield Figure(f"{what}: share within 80 %, off 80", abs(100 * _within(guesses) - 80), "points", goal=5.0)
        near = [abs(each.estimate - each.hidden) <= NEAR_MPH for each in guesses]
        by_rule = [abs(each.rule - each.hidden) <= NEAR_MPH for each in guesses]
        hidden = [each.hidden for each in guesses]
        yield Figure(
            f"{what}, of all crashes: within {NEAR_MPH:g} mph",
            100 * sum(near) / len(near),
            "%",
            "by chance",
            100 * sum(abs(one - two) <= NEAR_MPH for one in hidden for two in hidden) / len(hidden) ** 2,
            note=f"the rule {100 * sum(by_rule) / len(by_rule):.0f} %",
            hidden=len(hidden),
        )
        low, high = quantiles(hidden, n=10)[0], quantiles(hidden, n=10)[-1]
        yield Figure(
            f"{what}, of all crashes: in the interval of 80 %",
            100 * _within(guesses),
            "%",
            "by chance",
            80.0,
            note=f"intervals {median(each.high - each.low for each in guesses):.0f} mph wide in the median; by chance "
            f"{high - low:.0f}, of all that were hidden",
            hidden=len(hidden),
        )


def _pairs(guesses: Sequence[Guess]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    return [(each.hidden, each.estimate) for each in guesses], [(each.hidden, each.rule) for each in guesses]


def _within(guesses: Sequence[Guess]) -> float:
    return sum(each.low - 0.5 <= each.hidden <= each.high + 0.5 for each in guesses) / len(guesses)


def main() -> None:
    """Print the tables."""
    rows, recorded = asked_speeds(__doc__)
    print_guesses("Reported travel speeds, mph: median (mean) error", list(reported_guesses(rows)))
    print_guesses("Recorded speeds at the impact, mph", list(recorded_guesses(recorded)))


if __name__ == "__main__":
    main()
