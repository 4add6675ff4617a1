"""The check of a register's table before anything is registered, for the author of its mapping."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from trace_dag.common.errors import Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.completeness import check
from trace_dag.crash.record import CrashRecord, NonMotorist, Origin, VehicleRecord, origins


class Table(Protocol):
    """A table or folder whose crashes can be looked at before they are registered."""

    def notes(self) -> Sequence[str]:
        """Return how much is read, and what is not."""
        ...

    def records(self) -> Iterable[CrashRecord]:
        """Return every crash as read."""
        ...


def check_table(table: Table, settings: CrashSettings) -> Iterator[str]:
    """Yield the notes of a table.

    Then, for each kind of crash, how many there are, how many say enough to be reconstructed, and what the others lack;
    then in how many crashes each field is reported.
    """
    total: Counter[str] = Counter()
    lacking: dict[str, Counter[str]] = {}
    reported: Counter[str] = Counter()
    for record in map(complete_record, table.records()):
        total[record.kind] += 1
        parts: list[CrashRecord | VehicleRecord | NonMotorist] = [record, *record.vehicles, *record.non_motorists]
        reported.update({name for part in parts for name, origin in origins(part).items() if origin is Origin.REPORTED})
        try:
            check(record, settings)
        except Rejection as rejection:
            lacking.setdefault(record.kind, Counter())[rejection.reason] += 1
    yield from table.notes()
    for kind, count in total.most_common():
        reasons = lacking.get(kind, Counter())
        why = "".join(f", {number} {reason}" for reason, number in reasons.most_common())
        yield f"{kind}: {count} crashes, {count - reasons.total()} that say enough{why}"
    in_order = sorted(reported.items(), key=lambda each: (-each[1], each[0]))
    fields = ", ".join(f"{name} {count}" for name, count in in_order if name not in _OF_EVERY_RECORD)
    yield f"fields reported, in how many of {total.total()} crashes: {fields}"


_OF_EVERY_RECORD = frozenset(
    {"case_year", "number", "in_transport", "travel_speed_is_lower_bound", "person_type_code"}
) | {
    *("length_m", "width_m", "height_m", "mass_kg", "vehicle_class"),
    *("collision_type", "road_topology", "vehicle_trajectory", "position_accuracy_m"),
}
