"""Blueprints of CARLA for reported vehicles, people and bicycles.

CARLA shows a blueprint's size only after it is spawned. So the choice uses this table of rounded lengths and widths of
the bounding boxes in CARLA 0.9.15. The log records the box of the spawned actor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from trace_dag.common.data_files import read_csv
from trace_dag.common.errors import Failure
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import Body


@dataclass(frozen=True)
class Blueprint:
    """A vehicle of CARLA's library: id, the classes it represents (best first), length and width of its box."""

    id: str
    classes: tuple[VehicleClass, ...]
    length_m: float
    width_m: float


BLUEPRINTS = tuple(
    Blueprint(
        row["id"], tuple(map(VehicleClass, row["classes"].split())), float(row["length_m"]), float(row["width_m"])
    )
    for row in read_csv("trace_dag.scenario", "carla_blueprints.csv")
)
WALKERS = ("walker.pedestrian.0001", "walker.pedestrian.0004", "walker.pedestrian.0015")
CHILD_WALKERS = ("walker.pedestrian.0011", "walker.pedestrian.0014", "walker.pedestrian.0048")
"""Adults and children of CARLA's catalogue of pedestrians (0.9.16); any other adult does for an adult."""
BICYCLES = ("vehicle.bh.crossbike", "vehicle.gazelle.omafiets", "vehicle.diamondback.century")
_CHILD_STATURE_M = 1.45  # at about twelve years: CARLA's children are younger
_SECOND_CHOICE_M = 0.5  # size a blueprint made for the class may differ more than one that only does for it


def choose_blueprint(body: Body, available: Iterable[str]) -> Blueprint:
    """Return the server's blueprint nearest in class, then in length and width.

    Raises :class:`Failure` if it has none of them.

    >>> from trace_dag.simulation.types import BodyKind
    >>> bus = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.BUS, 12.0, 2.5, 3.2, 14000.0)
    >>> choose_blueprint(bus, ["vehicle.tesla.model3", "vehicle.mitsubishi.fusorosa"]).id
    'vehicle.mitsubishi.fusorosa'
    """
    present = set(available)
    candidates = [blueprint for blueprint in BLUEPRINTS if blueprint.id in present]
    if not candidates:
        raise Failure(
            f"CARLA's library has none of the {len(BLUEPRINTS)} vehicles known here; "
            "versions 0.9.15 and 0.9.16 with their standard assets do"
        )

    two_wheeled = body.vehicle_class is VehicleClass.MOTORCYCLE

    def unlike(blueprint: Blueprint) -> tuple[bool, bool, float]:
        size_m = math.hypot(blueprint.length_m - body.length_m, blueprint.width_m - body.width_m)
        if body.vehicle_class not in blueprint.classes:
            return True, two_wheeled is not (VehicleClass.MOTORCYCLE in blueprint.classes), size_m
        return False, False, size_m + blueprint.classes.index(body.vehicle_class) * _SECOND_CHOICE_M

    return min(candidates, key=unlike)


def choose_walker(body: Body, available: Iterable[str] = (*WALKERS, *CHILD_WALKERS)) -> str:
    """Return the server's walker for a person on foot, of a child for a child's stature.

    Raises :class:`Failure` if it has no walkers.
    """
    present = sorted(name for name in available if name.startswith("walker.pedestrian."))
    wanted = CHILD_WALKERS if body.height_m < _CHILD_STATURE_M else WALKERS
    found = next((name for name in (*wanted, *present) if name in present), None)
    if found is None:
        raise Failure("CARLA's library has no walkers; versions 0.9.15 and 0.9.16 with their standard assets do")
    return found


def choose_bicycle(available: Iterable[str] = BICYCLES) -> str:
    """Return the server's bicycle with rider.

    Raises :class:`Failure` if it has none.

    >>> choose_bicycle(["vehicle.gazelle.omafiets", "vehicle.tesla.model3"])
    'vehicle.gazelle.omafiets'
    """
    present = set(available)
    found = next((name for name in BICYCLES if name in present), None)
    if found is None:
        raise Failure("CARLA's library has no bicycles; versions 0.9.15 and 0.9.16 with their standard assets do")
    return found
