"""All benchmarks, or some: measured, kept, and shown.

    python -m benchmarks                       everything
    python -m benchmarks cold_start growth     some
    python -m benchmarks --runs 7 --no-keep    print only

The scripts beside this one (``roads.py``, ``map_agreement.py``, ``warehouse.py``, ``kills.py``, ...) look at one
subject in depth and are called by themselves.
"""

from __future__ import annotations

import argparse
import importlib
import sys

from benchmarks.measuring import Figure, exit_code
from benchmarks.results import keep

SUITES = ("cold_start", "stages", "orchestration", "growth", "throughput", "mask_and_predict", "masked_reports")


def main() -> int:
    """Exit code 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("suites", nargs="*", metavar="SUITE", help=f"of {', '.join(SUITES)}; all by default")
    parser.add_argument("--runs", type=int, default=3, help="runs of which the median counts (default 3)")
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    unknown = set(options.suites) - set(SUITES)
    if unknown:
        parser.error(f"no suite {', '.join(sorted(unknown))}; there is {', '.join(SUITES)}")
    figures: list[Figure] = []
    for suite in options.suites or SUITES:
        for figure in importlib.import_module(f"benchmarks.{suite}").measure(options.runs):
            figures.append(figure)
            print(_line(figure), flush=True)
            if not options.no_keep:
                keep([figure])
    return exit_code(figures)


def _line(figure: Figure) -> str:
    text = f"{figure.name:60} {figure.value:10.4g} {figure.unit}"
    if figure.hidden is not None:
        asked = "".join(f", {name} {share:.3g}" for name, share in figure.asked.items())
        text += f" of {figure.hidden} recovered; {figure.peer} {figure.peer_value:.3g}{asked}"
    elif figure.ratio is not None:
        text += f", {figure.ratio:.3g} times {figure.peer} ({figure.peer_value:.4g})"
    if figure.reached is not None:
        what = "ratio " if figure.goal_of_ratio else ""
        sign = ">=" if figure.at_least else "<="
        text += f"; goal {what}{sign} {figure.goal:.3g}: {'reached' if figure.reached else 'MISSED'}"
    return text + (f" [{figure.note}]" if figure.note else "")


if __name__ == "__main__":
    sys.exit(main())
