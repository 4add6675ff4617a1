"""The definition of a benchmark, ``trace-bench.json``: its contents and the comparison of agents on it.

Two groups can compare their benchmarks by it.

It names every crash with the digests of its report, of the map data around it and of its package, the crash's part, the
code and settings of every stage, and the rules of comparison. :func:`differences` lists the inputs that differ. Belongs
here: the content of the definition. Does not belong here: releasing it (:mod:`trace_dag.export.release`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.metrics import ENTERED_TTC_S
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.stage import Stage
from trace_dag.flow.records import Records
from trace_dag.scenario.cases import MOST_TIMES

FILE: Final = "trace-bench.json"
NAME: Final = "trace-bench 1"
_SHOWN: Final = 5


def definition(
    rows: Sequence[Mapping[str, Any]], records: Mapping[str, Records], made_on: str, weights: Mapping[str, Any] | None
) -> bytes:
    """Return the definition of the crashes in ``rows`` of a release's index, as UTF-8 JSON.

    Equal input gives equal bytes. ``weights`` describes the weights of the rows, or is None.
    """
    usual = Conditions(traffic=Traffic.PERSISTENT)
    document = {
        "name": NAME,
        "date": made_on,
        "traffic": usual.traffic.value,
        "conditions": {"rate_hz": usual.rate_hz, "range_m": usual.sensing.range_m, "noise_m": 0.0, "seed": usual.seed},
        "scoring": {
            "places": "both drivers' places of each crash in which somebody met somebody",
            "entered_s": ENTERED_TTC_S,
            "finished_within_times": MOST_TIMES,
            "score": "share of runs with conflict_avoided or collision_avoided; interval with the crash as the unit",
        },
        "weights": weights,
        "stages": _stages(list(records.values())),
        "crashes": {row["key"]: _crash(row, records[row["key"]]) for row in rows},
    }
    return (json.dumps(document, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode()


def _stages(records: Sequence[Records]) -> dict[str, list[Any]]:
    """Return the code, settings and libraries of each stage, as a list; one entry if all crashes were made alike."""
    found: dict[str, list[Any]] = {}
    for stage in Stage:
        made = [record[stage].provenance for record in records if stage in record]
        unlike = {json.dumps([each.code, each.settings, each.libraries], sort_keys=True) for each in made}
        found[stage.value] = [json.loads(each) for each in sorted(unlike)]
    return found


def _crash(row: Mapping[str, Any], record: Records) -> dict[str, Any]:
    (report, *_), (extract, *_) = record[Stage.RAW_REPORT].artefacts, record[Stage.OSM_EXTRACT].artefacts
    return {
        "kind": row["kind"],
        "split": row["split"],
        "weight": row["weight"],
        "report_sha256": report.sha256,
        "map_file": record[Stage.OSM_EXTRACT].figures.get("source"),
        "map_sha256": extract.sha256,
        "package_sha256": row["package_sha256"],
    }


def read_definition(data: bytes, name: str) -> dict[str, Any]:
    """Return a definition as read.

    Raises :class:`UserError` for other content or another version.
    """
    try:
        document = json.loads(data)
        if document["name"] == NAME and isinstance(document["crashes"], dict):
            return dict(document)
    except (ValueError, KeyError, TypeError):
        pass
    raise UserError(f"{name}: not a definition of {NAME}; a release has one as {FILE}")


def differences(given: Mapping[str, Any], made: Mapping[str, Any]) -> list[str]:
    """Return one sentence for each input that differs from a given definition.

    An input that follows from others is listed only if those are equal.

    >>> crash = {"report_sha256": "1", "map_sha256": "2", "package_sha256": "3"}
    >>> given = {"stages": {}, "weights": None, "crashes": {"2023-1": crash, "2023-2": crash}}
    >>> differences(given, given | {"crashes": {"2023-1": crash | {"report_sha256": "9"}}})
    ['not verified here: 2023-2', 'another report: 2023-1']
    """
    theirs, ours = given["crashes"], made["crashes"]
    both = [key for key in theirs if key in ours]

    def unlike(name: str) -> list[str]:
        return [key for key in both if theirs[key][name] != ours[key][name]]

    unlike_stages = [stage for stage, each in given["stages"].items() if each != made["stages"].get(stage)]
    found = [
        _named("not verified here", [key for key in theirs if key not in ours]),
        _named("another report", unlike("report_sha256")),
        _named("map files that differ around", unlike("map_sha256")),
        _named("other code, settings or libraries in", unlike_stages),
        "" if given["weights"] == made["weights"] else "other national tables, or none: --national",
    ]
    found = [each for each in found if each]
    if not found and given != made:
        found = [_named("another package", unlike("package_sha256")) or "another version of trace-dag"]
    return found


def _named(what: str, names: Sequence[str]) -> str:
    more = f" and {count_of(len(names) - _SHOWN, 'other')}" if len(names) > _SHOWN else ""
    return f"{what}: {', '.join(names[:_SHOWN])}{more}" if names else ""
