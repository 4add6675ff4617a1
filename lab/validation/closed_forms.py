"""The simulator against closed forms: what sliding, braking, restitution, a throw and a rollover come to on paper."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from lab.validation.placing import straight_on
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.body_sizes import person_body
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.objects import KINDS, FixedObject
from trace_dag.simulation.overturn import roll_model
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import Body, BodyKind, Participant, SimulationLog, overturned_at
from trace_dag.verdict.throws import throw_bounds_m

_CAR: Final = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.7, 1.85, 1.45, 1500.0)
_PICKUP: Final = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.PICKUP, 5.6, 2.0, 1.9, 2500.0)
_CURB: Final = 33
_TRIES: Final = 7
_ICE: Final = 0.001


@dataclass(frozen=True)
class ClosedForm:
    """A quantity by its law, least and most where the law has bounds, and as simulated."""

    what: str
    least: float
    most: float
    simulated: float
    unit: str
    source: str


def closed_forms(settings: SimSettings) -> list[ClosedForm]:
    """Return every law, in the order of this page."""
    return [
        _sliding(settings),
        _braking(settings),
        *(_restitution(settings, body, speed) for body, speed in ((_CAR, 14.0), (_PICKUP, 20.0))),
        _throw(settings),
        _tripping(settings),
    ]


def _run(settings: SimSettings, *participants: Participant, objects: tuple[FixedObject, ...] = ()) -> SimulationLog:
    simulation = EmbeddedSimulation(settings, Surface(), settings.friction)
    return simulation.run(participants, time_limit_s=30.0, objects=objects)


def _planned(speed_of_time: Callable[[float], float], x_m: float = 0.0, seconds: float = 12.0) -> Participant:
    time_s = np.arange(0.0, seconds, 0.02)
    speed = np.array([speed_of_time(t) for t in time_s.tolist()])
    x = x_m + np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * 0.02)])
    zero = np.zeros_like(time_s)
    return Participant(1, _CAR, Pose(x_m, 0.0, 0.0), float(speed[0]), Trajectory(time_s, x, zero, zero, zero, speed))


def _sliding(settings: SimSettings) -> ClosedForm:
    """Return a car with locked wheels, let go beyond the end of its plan."""
    speed, after_s = 20.0, 0.5
    plan = _planned(lambda _: speed, seconds=after_s + 0.02)
    other = straight_on(2, _CAR, Pose(0.0, 80.0, 0.0), 0.0)
    locked = settings.model_copy(update={"locked_wheels": 1.0})
    log = EmbeddedSimulation(locked, Surface(), settings.friction).run(
        (plan, other), time_limit_s=20.0, objects=(_wall(200.0),)
    )
    law = speed**2 / (2 * settings.friction * GRAVITY_MPS2)
    slid = float(log.vehicles[0].x_m.max()) - speed * after_s
    return ClosedForm("distance of a slide from 20 m/s", law, law, slid, "m", "v² / (2 μ g)")


def _braking(settings: SimSettings) -> ClosedForm:
    """Return a driver who asks for more than the road gives."""
    speed, brake_s = 25.0, 1.0
    log = _run(settings, _planned(lambda t: max(speed - 15.0 * max(t - brake_s, 0.0), 0.0)))
    law = speed**2 / (2 * settings.friction * GRAVITY_MPS2)
    braked = float(log.vehicles[0].x_m.max()) - speed * brake_s
    return ClosedForm("distance of braking from 25 m/s, wheels at their limit", law, law, braked, "m", "v² / (2 μ g)")


def _restitution(settings: SimSettings, body: Body, speed_mps: float) -> ClosedForm:
    """Return the straight into the rear of one that stands: what both have after it, by what restitution the contact
    returned.
    """
    one = straight_on(1, _CAR, Pose(-20.0, 0.0, 0.0), speed_mps)
    two = straight_on(2, body, Pose(0.0, 0.0, 0.0), 0.0)
    contact = _run(settings, one, two).contacts[0]
    share = body.mass_kg / (_CAR.mass_kg + body.mass_kg)
    least, most = (share * (1 + e) * speed_mps for e in (0.0, 0.3))
    return ClosedForm(
        f"delta-v of a car into a standing {body.vehicle_class} at {speed_mps:g} m/s",
        least,
        most,
        -contact.delta_v_1_mps[0],
        "m/s",
        "(1 + e) m₂ v / (m₁ + m₂), e from 0 to 0.3",
    )


def _throw(settings: SimSettings) -> ClosedForm:
    """Return an adult struck by a car that brakes from then on; the bounds are of the car's speed at the strike."""
    speed, strike_s = 15.0, 1.0
    front_m = _CAR.length_m / 2 + 0.3
    car = _planned(lambda t: max(speed - 7.0 * max(t - strike_s, 0.0), 0.0), -speed * strike_s - front_m)
    body = person_body(BodyKind.PEDESTRIAN, 35)
    walks = 1.4
    path = straight_on(1001, body, Pose(0.0, -walks * strike_s, math.pi / 2), walks)
    log = _run(settings, car, path)
    start, person = log.contacts[0].pose_2, log.vehicles[1]
    thrown = math.hypot(float(person.x_m[-1]) - start.x_m, float(person.y_m[-1]) - start.y_m)
    bounds = throw_bounds_m(speed, settings.person_friction)
    return ClosedForm("throw of an adult struck at 15 m/s", *bounds, thrown, "m", "Searle, SAE 831622")


def _tripping(settings: SimSettings) -> ClosedForm:
    """Return the speed from which on a car that slides sideways into a kerb goes over, by halving: on ice, since the
    law knows no force but the kerb's.
    """
    settings = settings.model_copy(update={"friction": _ICE})
    model = roll_model(_CAR)
    assert model is not None
    low, high = 0.5 * model.critical_mps, 1.5 * model.critical_mps
    for _ in range(_TRIES):
        middle = (low + high) / 2
        low, high = (low, middle) if _goes_over(settings, middle) else (middle, high)
    law = model.critical_mps
    return ClosedForm(
        "speed against a kerb from which a car overturns", law, law, (low + high) / 2, "m/s", "Jones, SAE 750461"
    )


def _goes_over(settings: SimSettings, speed_mps: float) -> bool:
    kind = KINDS[_CURB]
    kerb = FixedObject(
        2001, 1, _CURB, kind.name, Pose(0.0, 0.0, 0.0), kind.length_m, kind.width_m, kind.height_m, kind.resistance
    )
    start = Pose(0.0, -_CAR.width_m / 2 - kind.width_m / 2 - 0.05 - 0.1 * speed_mps, 0.0)
    slides = straight_on(1, _CAR, start, speed_mps, course_rad=math.pi / 2)
    let_go = replace(slides, trajectory=_first(slides.trajectory, 0.2))
    return overturned_at(_run(settings, let_go, objects=(kerb,)).vehicles[0]) is not None


def _first(plan: Trajectory, seconds: float) -> Trajectory:
    use = plan.time_s <= seconds + 1e-9
    return Trajectory(
        plan.time_s[use], plan.x_m[use], plan.y_m[use], plan.z_m[use], plan.heading_rad[use], plan.speed_mps[use] * 0
    )


def _wall(x_m: float) -> FixedObject:
    kind = KINDS[39]
    return FixedObject(
        2001, 1, 39, kind.name, Pose(x_m, 0.0, math.pi / 2), 20.0, kind.width_m, kind.height_m, kind.resistance
    )
