"""Crash types that follow from manner, movements and directions: by the diagrams of the coding manual."""

from __future__ import annotations

import pytest

from trace_dag.crash.completed_record import complete_record, drop_headings
from trace_dag.crash.record import (
    CrashRecord,
    EventRecord,
    Heading,
    Moment,
    Octant,
    PreCrashMovement,
    VehicleClass,
    VehicleRecord,
)

STRAIGHT, STOPPED, SLOWING = PreCrashMovement.GOING_STRAIGHT, PreCrashMovement.STOPPED, PreCrashMovement.DECELERATING
LEFT, RIGHT = PreCrashMovement.TURNING_LEFT, PreCrashMovement.TURNING_RIGHT
MOMENT = {LEFT: Moment.UNKNOWN, RIGHT: Moment.UNKNOWN}
NORTH, EAST, SOUTH, WEST = Octant.NORTH, Octant.EAST, Octant.SOUTH, Octant.WEST
REAR_END, ANGLE = 1, 6


def crash(man_coll: int, *courses: tuple[PreCrashMovement, Octant | None]) -> CrashRecord:
    """Two cars of a register without crash types and areas."""
    vehicles = tuple(
        VehicleRecord(
            number, VehicleClass.CAR, 4.8, 1.8, 1.5, 1500.0, movement=movement,
            heading=None if octant is None else Heading(octant, MOMENT.get(movement, Moment.BEFORE)),
        )
        for number, (movement, octant) in enumerate(courses, 1)
    )  # fmt: skip
    contact = EventRecord(1, 12, 1, None, 2, None, ("code",))
    return CrashRecord(
        "town-1", 2020, None, 33.4, -111.9, vehicles, (contact,), register="town",
        register_lacks=("impact", "crash_type_code"), manner_of_collision_code=man_coll, first_harmful_event_code=12,
        junction_relation_code=2,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("man_coll", "one", "two", "types"),
    [
        (REAR_END, (STRAIGHT, EAST), (STOPPED, EAST), (20, 21)),
        (REAR_END, (STOPPED, None), (STRAIGHT, None), (21, 20)),
        (REAR_END, (STRAIGHT, EAST), (SLOWING, EAST), (28, 29)),
        (REAR_END, (STRAIGHT, EAST), (LEFT, NORTH), (24, 26)),
        (REAR_END, (STRAIGHT, EAST), (RIGHT, EAST), (24, 27)),
        (REAR_END, (STRAIGHT, EAST), (STRAIGHT, EAST), (None, None)),  # who was ahead is not told
        (ANGLE, (STRAIGHT, EAST), (STRAIGHT, NORTH), (91, 91)),  # straight paths cross; who struck is not told
        (ANGLE, (STRAIGHT, EAST), (STRAIGHT, EAST), (None, None)),  # the report contradicts itself
        (ANGLE, (LEFT, NORTH), (STRAIGHT, EAST), (82, 83)),  # came from the right, and turned against it
        (ANGLE, (STRAIGHT, WEST), (LEFT, SOUTH), (83, 82)),
        (ANGLE, (LEFT, WEST), (STRAIGHT, EAST), (None, None)),  # before its turn (68), or after one from the right (82)
        (ANGLE, (LEFT, SOUTH), (STRAIGHT, EAST), (None, None)),  # after a turn across (68), or before one (76)
        (ANGLE, (STRAIGHT, None), (STRAIGHT, None), (None, None)),
    ],
)
def test_types_are_set_where_one_configuration_fits(man_coll, one, two, types):
    record = complete_record(crash(man_coll, one, two))
    assert tuple(vehicle.crash_type_code for vehicle in record.vehicles) == types
    assert all(("crash_type_code" in vehicle.implied) is (types[0] is not None) for vehicle in record.vehicles)


@pytest.mark.parametrize("courses", [((STRAIGHT, EAST), (STRAIGHT, NORTH)), ((STRAIGHT, EAST), (STOPPED, EAST))])
@pytest.mark.parametrize("man_coll", [REAR_END, ANGLE])
def test_without_headings_a_record_is_what_it_would_be_without_them(man_coll, courses):
    with_them = complete_record(crash(man_coll, *courses))
    hidden = complete_record(crash(man_coll, *((movement, None) for movement, _ in courses)))
    assert drop_headings(with_them) == hidden
