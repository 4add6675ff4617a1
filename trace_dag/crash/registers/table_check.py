"""Check of a table that a mapping reads: what is read and what is not, before anything is registered."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Protocol

from trace_dag.common.errors import Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.completeness import check
from trace_dag.crash.record import CrashRecord, NonMotorist, Origin, VehicleRecord, origins
from trace_dag.crash.registers.mapping import MOMENT

_OF_EVERY_RECORD: Final = frozenset(
    {
        *("case_year", "number", "keeps_left", "in_transport", "travel_speed_is_lower_bound", "person_type_code"),
        *("length_m", "width_m", "height_m", "mass_kg", "vehicle_class"),
        *("collision_type", "road_topology", "vehicle_trajectory", "position_accuracy_m"),
    }
)


class Table(Protocol):
    """A table or folder whose crashes can be looked at before they are registered."""

    def notes(self) -> Sequence[str]:
        """Return notes on the rows and values that were read and those that were not."""
        ...

    def records(self) -> Iterable[CrashRecord]:
        """Return every crash as read."""
        ...


def check_table(table: Table, settings: CrashSettings) -> Iterator[str]:
    """Yield the notes of a table, then counts by kind of crash and by field.

    For each kind: the number of crashes, the number that can be reconstructed, and what the others lack. For each
    field: the number of crashes that report it, and the number in which other fields imply it.
    """
    total: Counter[str] = Counter()
    lacking: dict[str, Counter[str]] = {}
    on_the_left = 0
    found: dict[Origin, Counter[str]] = {origin: Counter() for origin in Origin}
    for record in map(complete_record, table.records()):
        total[record.kind] += 1
        on_the_left += record.keeps_left
        parts: list[CrashRecord | VehicleRecord | NonMotorist] = [record, *record.vehicles, *record.non_motorists]
        for name, origin in {pair for part in parts for pair in origins(part).items()}:
            found[origin][name] += 1
        try:
            check(record, settings)
        except Rejection as rejection:
            lacking.setdefault(record.kind, Counter())[rejection.reason] += 1
    yield from table.notes()
    for kind, count in total.most_common():
        reasons = lacking.get(kind, Counter())
        why = "".join(f", {number} {reason}" for reason, number in reasons.most_common())
        yield f"{kind}: {count} crashes, {count - reasons.total()} with enough facts{why}"
    if on_the_left:
        yield f"traffic keeps left in {on_the_left} of {total.total()} crashes, by the mapping or the point's country"
    times = ", ".join(f"{part} {found[Origin.REPORTED][part]}" for part in MOMENT)
    yield f"time of {total.total()} crashes: {times}; the rest is not reported"
    for origin, words in ((Origin.REPORTED, "reported"), (Origin.IMPLIED, "implied by others")):
        in_order = sorted(found[origin].items(), key=lambda each: (-each[1], each[0]))
        named = (f"{name} {count}" for name, count in in_order if name not in _OF_EVERY_RECORD.union(MOMENT))
        yield f"fields {words}, in how many of {total.total()} crashes: {', '.join(named)}"
