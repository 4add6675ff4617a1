"""Figures over versions, kept in ``benchmarks/results.json`` and shown in ``docs/reference/benchmarks.md``."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.measuring import Figure
from trace_dag.version import __version__

_ROOT = Path(__file__).resolve().parents[1]
RESULTS = _ROOT / "benchmarks" / "results.json"
PAGE = _ROOT / "docs" / "reference" / "benchmarks.md"
_SHOWN = 5  # measurements whose figures are shown: what has not been measured since is out of date


def append(figures: Sequence[Figure], path: Path = RESULTS) -> list[dict[str, Any]]:
    """Add a measurement to those before; all of them. One of the same version and machine takes over its figures."""
    measurements: list[dict[str, Any]] = json.loads(path.read_text()) if path.is_file() else []
    about = {
        "version": f"{__version__} ({_revision()})",
        "machine": f"{os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}",
    }
    measured = {figure.name: {**asdict(figure), "ratio": figure.ratio, "reached": figure.reached} for figure in figures}
    beside = {"load": round(os.getloadavg()[0], 1), "loop_ms": round(_loop_ms(), 1)}
    for measured_figure in measured.values():
        measured_figure |= beside
    last = measurements[-1] if measurements else {}
    if {name: last.get(name) for name in about} == about:
        last["figures"] |= measured
    else:
        moment = datetime.now(UTC).isoformat(timespec="minutes")
        measurements.append({**about, "measured_at": moment, "figures": measured})
    path.write_text(json.dumps(measurements, indent=1) + "\n")
    return measurements


def keep(figures: Sequence[Figure]) -> None:
    """Add a measurement to those before, and write the page anew."""
    PAGE.write_text(page(append(figures)))


def page(measurements: Sequence[dict[str, Any]]) -> str:
    """Each figure of the latest measurements as it was measured last, as Markdown."""
    latest = {
        name: (figure, each)
        for each in measurements[-_SHOWN:]
        for name, figure in each["figures"].items()
        if figure.get("hidden") is None
    }
    lines = [
        "# Benchmarks",
        "",
        "Each figure is the median of several runs. Where the table names a peer (another way to do the same work),",
        "the two ran by turns, and the ratio to the peer stands in brackets. Times are CPU time unless a note says",
        "otherwise. **Bold** figures miss their goal. The last column is the version of the code that was measured.",
        "Shared machines change their speed from minute to minute, so the list below the table says how long one",
        "fixed loop of plain Python took beside each version's figures: compare versions with that in mind.",
        "",
        "`python -m benchmarks` measures and writes this page; all measurements, older ones too, are in",
        "`benchmarks/results.json`.",
        "",
        "| | unit | peer | goal | measured | with |",
        "|---|---|---|---|---:|---|",
    ]
    for name, (figure, measured) in latest.items():
        cells = [name, figure["unit"], figure["peer"], _goal(figure), _cell(figure), measured["version"]]
        lines.append(f"| {' | '.join(cells)} |")
    shown = [each for each in measurements if any(measured is each for _, measured in latest.values())]
    lines += ["", *(f"- {each['version']}: {each['measured_at']}, {each['machine']}{_loop(each)}" for each in shown)]
    lines += [f"- {name}: {figure['note']}" for name, (figure, _) in latest.items() if figure["note"]]
    return "\n".join([*lines, *_calibration(measurements)]) + "\n"


def _calibration(measurements: Sequence[dict[str, Any]]) -> list[str]:
    """The table of what came back when it was hidden, each row as it was measured last."""
    rows = {
        name: (figure, each["version"])
        for each in measurements
        for name, figure in each["figures"].items()
        if figure.get("hidden") is not None
    }
    if not rows:
        return []
    models = list(dict.fromkeys(model for figure, _ in rows.values() for model in figure["asked"]))
    columns = ["hidden", "number", "recovered", "by chance", *(models or ["published model's kind"]), "measured with"]
    lines = [
        "",
        "## Calibration",
        "",
        "One thing that is known is hidden, estimated again from the rest, and compared: the share that comes back,",
        "and what chance gives, which draws the answer from what all crashes have. [How sure the estimates",
        "are](../explanation/how-sure-the-estimates-are.md) says what each row is. A language model that is configured",
        "(`TRACE_DAG_STATES__LLM_MODEL`) has a column of its own: it is asked for coordinates, as the published study",
        "asked, and what it cannot answer counts as not recovered." + ("" if models else " None was, here."),
        "",
        "| " + " | ".join(columns) + " |",
        "|---|" + "---:|" * (len(columns) - 2) + "---|",
    ]
    for name, (figure, version) in rows.items():
        asked = [f"{figure['asked'][model]:.0f} %" if model in figure["asked"] else "" for model in models] or ["-"]
        shares = [f"{figure[key]:.0f} %" for key in ("value", "peer_value")]
        lines.append(f"| {' | '.join([name, str(figure['hidden']), *shares, *asked, version])} |")
    return [*lines, "", *(f"- {name}: {figure['note']}" for name, (figure, _) in rows.items() if figure["note"])]


def _loop_ms() -> float:
    """How fast the machine is at this moment: CPU time of a fixed loop, median of five."""
    times_s = []
    for _ in range(5):
        start = time.thread_time()
        sum(number * number % 7 for number in range(200_000))
        times_s.append(time.thread_time() - start)
    return 1e3 * statistics.median(times_s)


def _loop(measurement: dict[str, Any]) -> str:
    times_ms = [figure["loop_ms"] for figure in measurement["figures"].values() if "loop_ms" in figure]
    return f", loop {min(times_ms):.0f} to {max(times_ms):.0f} ms" if times_ms else ""


def _cell(figure: dict[str, Any]) -> str:
    text = _short(figure["value"], 3) + (f" ({_short(figure['ratio'], 2)})" if figure["ratio"] else "")
    return f"**{text}**" if figure["reached"] is False else text


def _goal(figure: dict[str, Any]) -> str:
    if figure["goal"] is None:
        return ""
    return (
        f"{'ratio ' if figure['goal_of_ratio'] else ''}{'≥' if figure['at_least'] else '≤'} {_short(figure['goal'], 3)}"
    )


def _short(number: float, digits: int) -> str:
    """To so many digits, without an exponent."""
    return f"{number:,.0f}" if abs(number) >= 10**digits else f"{number:.{digits}g}"


def _revision() -> str:
    answer = subprocess.run(["git", "-C", str(_ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return answer.stdout.strip() or "no revision"
