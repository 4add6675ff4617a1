"""Blueprints of CARLA for reported vehicles, people and bicycles.

CARLA shows a blueprint's size only after it is spawned. So the choice uses this table of rounded lengths and widths of
the bounding boxes in CARLA 0.9.15. The log records the box of the spawned actor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from trace_dag.common.errors import Failure
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import Body

_C = VehicleClass


@dataclass(frozen=True)
class Blueprint:
    """A vehicle of CARLA's library: id, the classes it represents (best first), length and width of its box."""

    id: str
    classes: tuple[VehicleClass, ...]
    length_m: float
    width_m: float


BLUEPRINTS = (
    Blueprint("vehicle.audi.a2", (_C.CAR,), 3.71, 1.79),
    Blueprint("vehicle.nissan.micra", (_C.CAR,), 3.63, 1.85),
    Blueprint("vehicle.mini.cooper_s_2021", (_C.CAR,), 4.55, 2.10),
    Blueprint("vehicle.seat.leon", (_C.CAR,), 4.19, 1.82),
    Blueprint("vehicle.toyota.prius", (_C.CAR,), 4.51, 2.01),
    Blueprint("vehicle.mercedes.coupe_2020", (_C.CAR,), 4.67, 1.81),
    Blueprint("vehicle.tesla.model3", (_C.CAR, _C.OTHER), 4.79, 2.16),
    Blueprint("vehicle.lincoln.mkz_2020", (_C.CAR,), 4.89, 1.84),
    Blueprint("vehicle.dodge.charger_2020", (_C.CAR,), 5.01, 1.88),
    Blueprint("vehicle.chevrolet.impala", (_C.CAR,), 5.36, 2.03),
    Blueprint("vehicle.jeep.wrangler_rubicon", (_C.SUV,), 3.87, 1.91),
    Blueprint("vehicle.nissan.patrol_2021", (_C.SUV, _C.PICKUP), 5.57, 2.15),
    Blueprint("vehicle.audi.etron", (_C.SUV,), 4.86, 2.03),
    Blueprint("vehicle.tesla.cybertruck", (_C.PICKUP, _C.LIGHT_TRUCK), 6.27, 2.39),
    Blueprint("vehicle.volkswagen.t2_2021", (_C.VAN,), 4.44, 1.77),
    Blueprint("vehicle.mercedes.sprinter", (_C.VAN, _C.LIGHT_TRUCK), 5.92, 1.99),
    Blueprint("vehicle.ford.ambulance", (_C.LIGHT_TRUCK, _C.VAN), 6.37, 2.35),
    Blueprint("vehicle.carlamotors.carlacola", (_C.TRUCK, _C.LIGHT_TRUCK), 5.20, 2.61),
    Blueprint("vehicle.carlamotors.firetruck", (_C.TRUCK, _C.TRACTOR_TRAILER), 8.47, 2.89),
    Blueprint("vehicle.carlamotors.european_hgv", (_C.TRACTOR_TRAILER, _C.TRUCK), 7.94, 2.89),
    Blueprint("vehicle.mitsubishi.fusorosa", (_C.BUS,), 10.27, 3.94),
    Blueprint("vehicle.vespa.zx125", (_C.MOTORCYCLE,), 1.81, 0.87),
    Blueprint("vehicle.kawasaki.ninja", (_C.MOTORCYCLE,), 2.03, 0.80),
    Blueprint("vehicle.yamaha.yzf", (_C.MOTORCYCLE,), 2.19, 0.87),
    Blueprint("vehicle.harley-davidson.low_rider", (_C.MOTORCYCLE,), 2.35, 0.76),
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
