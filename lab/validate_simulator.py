"""The simulator against measurement: ``python -m lab validate_simulator``."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import click

from lab.commands import run_study
from lab.validation.closed_forms import closed_forms
from lab.validation.crashes import compare_crash
from lab.validation.recorded import read_recorded_crashes
from lab.validation.rows import Compared
from lab.validation.staged import staged_results
from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, progress_of, say, write_json
from trace_dag.common.messages.wording import percent
from trace_dag.flow.workspace import stored_settings


@click.command(
    epilog=examples(
        "python -m lab validate_simulator",
        "python -m lab validate_simulator --ciren cases.json",
        "python -m lab validate_simulator --ciren cases.json --json",
    ),
)
@click.option(
    "--ciren",
    "cases",
    type=click.Path(path_type=Path),
    help="Crashes with event data recorders: a JSON list of NHTSA CIREN cases.",
)
@click.option("--json", "as_json", is_flag=True, help="Every vehicle of every case, as JSON; needs --ciren.")
@click.pass_obj
def validate_simulator(root: str, cases: Path | None, as_json: bool) -> None:
    """Set the simulator beside what was measured: recorders in crashes, staged collisions, closed forms.

    Every figure stands beside the plainest rule there is, planar plastic momentum. Uses the settings of the root.
    """

    settings = stored_settings(root).sim
    if as_json and cases is None:
        raise click.UsageError("--json prints the vehicles of --ciren FILE; name the file")
    rows: list[Compared] = []
    if cases is not None:
        crashes = read_recorded_crashes(cases)
        with progress_of("cases", len(crashes)) as on_progress:
            for crash in crashes:
                rows += compare_crash(crash, settings)
                on_progress(f"case {crash.case}")
    if as_json:
        write_json([row.published() for row in rows])
        return
    if cases is not None:
        _print_crashes(rows)
    print_table(
        ["staged test", "vehicle", "delta-v, km/h", "simulated", "plastic", "yaw, deg/s", "simulated yaw"],
        [
            (
                f"NHTSA {each.test}",
                each.vehicle,
                *(round(value, 1) for value in (each.measured_delta_v_kmh, each.simulated_delta_v_kmh)),
                round(each.plastic_delta_v_kmh, 1),
                round(each.measured_yaw_dps),
                round(each.simulated_yaw_dps),
            )
            for each in staged_results(settings)
        ],
    )
    say()
    print_table(
        ["closed form", "least", "most", "simulated", "unit", "law"],
        [
            (form.what, round(form.least, 2), round(form.most, 2), round(form.simulated, 2), form.unit, form.source)
            for form in closed_forms(settings)
        ],
    )


def _print_crashes(rows: list[Compared]) -> None:
    from lab.validation.summary import DIRECTION_WITHIN_DEG, errors_by_group

    compared = [row for row in rows if row.reason is None]
    print_table(
        ["case", "vehicle", "kind", "delta-v, km/h", "simulated", "plastic", "force from, deg", "simulated from"],
        [
            (
                row.case,
                row.vehicle,
                row.kind,
                _round(row.measured_delta_v_kmh, 1),
                _round(row.simulated_delta_v_kmh, 1),
                _round(row.plastic_delta_v_kmh, 1),
                _round(row.measured_direction_deg, 0),
                _round(row.simulated_direction_deg, 0),
            )
            for row in compared
        ],
    )
    say()
    reasons = Counter(row.reason for row in rows if row.reason is not None)
    print_table(["not compared", "vehicles"], [(reason, count) for reason, count in reasons.most_common()])
    say()
    print_table(
        [
            "error of delta-v",
            "vehicles",
            "median",
            "with its sign",
            "worst",
            "plastic median",
            "plastic worst",
            f"force within {DIRECTION_WITHIN_DEG:g} deg",
            "crush median",
            "pulse, ms",
        ],
        [
            (
                group.group,
                group.vehicles,
                *(
                    percent(share)
                    for share in (
                        group.median_error,
                        group.leaning,
                        group.worst_error,
                        group.plastic_median_error,
                        group.plastic_worst_error,
                        group.direction_share,
                        group.crush_median_error,
                    )
                ),
                None if group.pulse_median_s is None else round(1000 * group.pulse_median_s),
            )
            for group in errors_by_group(rows)
        ],
    )
    say()


def _round(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


if __name__ == "__main__":
    run_study(validate_simulator)
