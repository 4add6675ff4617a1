"""Two vehicles that met: set up from what was measured of both; a speed that was not recorded is fitted.

It is fitted to the delta-v that investigators reconstructed from crush with WinSMASH, which knows no tyres and takes
it that nothing springs back (Niehoff and Gabler 2006: 23 % below recorders, 1 % in frontal crashes once the rebound
is added). So what the contact does is fitted, without rebound, as in the plastic peer; both are in what is compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from lab.validation.placing import OUTWARD, damaged_m, meeting, struck_side
from lab.validation.plastic import in_body, plastic_delta_v
from lab.validation.recorded import RecordedEvent, RecordedVehicle, Recording
from lab.validation.rows import (
    Compared,
    Unusable,
    Vector,
    check_recording,
    compared_row,
    simulate,
)
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import kmh_to_mps
from trace_dag.simulation.types import Body, SimulationLog

_CONTRADICTION: Final = 2.0
_FASTEST_MPS: Final = kmh_to_mps(200.0)
_TRIED: Final = 17
_REFINED: Final = 8


@dataclass(frozen=True)
class _Pair:
    """Two vehicles ready to be simulated at any speeds."""

    bodies: tuple[Body, Body]
    headings_rad: tuple[float, float]
    damaged: tuple[Vector, Vector]
    outward: tuple[Vector, Vector]  # from the side of each that was struck, ahead and to the left
    locked_wheels: tuple[float | None, float | None]

    def velocities(self, speeds_mps: tuple[float, float]) -> tuple[Vector, Vector]:
        one, two = (
            (speed * math.cos(heading), speed * math.sin(heading))
            for speed, heading in zip(speeds_mps, self.headings_rad, strict=True)
        )
        return one, two

    def closes(self, speeds_mps: tuple[float, float]) -> bool:
        """Return whether the struck side of one of them at least comes nearer to the other.

        A vehicle that runs into the rear of another is the faster: with the other faster still its front would
        strike the first."""
        (vx1, vy1), (vx2, vy2) = self.velocities(speeds_mps)
        past = (vx1 - vx2, vy1 - vy2), (vx2 - vx1, vy2 - vy1)
        return any(
            ahead * out[0] + left * out[1] > 0.0
            for (ahead, left), out in zip(
                (in_body(one, heading) for one, heading in zip(past, self.headings_rad, strict=True)),
                self.outward,
                strict=True,
            )
        )

    def plastic(self, speeds_mps: tuple[float, float]) -> tuple[Vector, Vector]:
        """Return the delta-v of both, each ahead and to the left."""
        changes = plastic_delta_v((self.bodies[0].mass_kg, self.bodies[1].mass_kg), *self.velocities(speeds_mps))
        one, two = (in_body(change, heading) for change, heading in zip(changes, self.headings_rad, strict=True))
        return one, two

    def simulated(self, speeds_mps: tuple[float, float], settings: SimSettings) -> SimulationLog | None:
        """Return the crash; None if they never meet with the sides that were struck."""
        if not self.closes(speeds_mps):
            return None
        placed = meeting(self.bodies, self.headings_rad, speeds_mps, self.damaged, self.locked_wheels)
        if placed is None:
            return None
        log = simulate(placed, settings)
        return log if log.first_contact is not None else None


def compare_pair(
    case: str, event: RecordedEvent, pair: tuple[RecordedVehicle, RecordedVehicle], settings: SimSettings
) -> Iterator[Compared]:
    """Yield both vehicles of an event, the one without a recorder with that reason; :class:`Unusable` where it cannot
    be.
    """
    ready = _ready(event, pair)
    recordings = tuple(vehicle.recording(event.number) for vehicle in pair)
    both = all(recording is not None for recording in recordings)
    if both:
        _check_momentum(ready, recordings)
    for vehicle, recording, outward in zip(pair, recordings, ready.outward, strict=True):
        if recording is not None:
            check_recording(vehicle, recording, outward)
    known = [
        recording.speed_mps if recording is not None else vehicle.speeds_mps.get(event.number)
        for vehicle, recording in zip(pair, recordings, strict=True)
    ]
    speeds = peer_speeds = (known[0] or 0.0, known[1] or 0.0)
    if None in known:
        if known == [None, None]:
            raise Unusable("no recorder has a speed before the impact")
        free = known.index(None)
        target = _target(pair, event.number, free)
        crushing = settings.model_copy(update={"restitution": 0.0})
        speeds = _fitted(lambda s: _simulated_delta_v(ready, s, crushing, target[0]), known, free, target[1])
        peer_speeds = _fitted(lambda s: _plastic_delta_v(ready, s, target[0]), known, free, target[1])
    log = ready.simulated(speeds, settings)
    if log is None:
        raise Unusable("placed by their damage and at these speeds the two never meet")
    plastic = ready.plastic(peer_speeds)
    for index, (vehicle, recording) in enumerate(zip(pair, recordings, strict=True)):
        if recording is None:
            yield Compared(
                case, vehicle.number, "one", reason=f"vehicle {vehicle.number} has no recorded delta-v of this event"
            )
            continue
        kind = "both" if both and None not in known else "one"
        yield compared_row(case, vehicle, event.number, kind, plastic[index], log, index)


def _ready(event: RecordedEvent, pair: tuple[RecordedVehicle, RecordedVehicle]) -> _Pair:
    bodies, headings, damaged, outward = [], [], [], []
    for vehicle, other, area in zip(pair, reversed(pair), (event.area, event.other_area), strict=True):
        if vehicle.body is None:
            raise Unusable(f"vehicle {vehicle.number}: its mass is not known")
        damage = vehicle.damage(event.number)
        noted = (vehicle.heading_rad, damage.heading_rad if damage is not None else None, other.seen_heading_rad)
        heading_rad = next((heading for heading in noted if heading is not None), None)
        if heading_rad is None:
            raise Unusable(f"vehicle {vehicle.number}: its heading at the impact is not known")
        side = struck_side(damage, area)
        if side is None:
            raise Unusable(f"vehicle {vehicle.number}: struck at {area!r}, which is not a side of a vehicle")
        bodies.append(vehicle.body)
        headings.append(heading_rad)
        damaged.append(damaged_m(vehicle, vehicle.body, damage, side))
        outward.append(OUTWARD[side])
    one, two = pair
    return _Pair(
        (bodies[0], bodies[1]),
        (headings[0], headings[1]),
        (damaged[0], damaged[1]),
        (outward[0], outward[1]),
        (one.locked_wheels(event.number), two.locked_wheels(event.number)),
    )


def _check_momentum(ready: _Pair, recordings: tuple[Recording | None, ...]) -> None:
    """Check that both felt the same impulse: of those recorded, neither may be a multiple of the other."""
    felt = []
    for body, recording in zip(ready.bodies, recordings, strict=True):
        assert recording is not None
        felt.append((body.mass_kg * recording.delta_v_mps, recording.whole))
    for (own, whole), (other, _) in ((felt[0], felt[1]), (felt[1], felt[0])):
        if whole and other > _CONTRADICTION * own:
            raise Unusable(
                f"the recorders contradict each other: impulses of {felt[0][0] / 1000:.0f} and "
                f"{felt[1][0] / 1000:.0f} kNs by mass and delta-v, which ought to be equal"
            )


def _target(pair: tuple[RecordedVehicle, RecordedVehicle], event: int, free: int) -> tuple[int, float]:
    """Return the vehicle whose reconstructed delta-v the free speed is fitted to, and that delta-v."""
    for index in (1 - free, free):
        delta_v = pair[index].reconstructed_mps.get(event)
        if delta_v:
            return index, delta_v
    raise Unusable(
        f"vehicle {pair[free].number}: its speed is not recorded, and no delta-v was reconstructed to fit it to"
    )


def _simulated_delta_v(ready: _Pair, speeds_mps: tuple[float, float], settings: SimSettings, index: int) -> float:
    log = ready.simulated(speeds_mps, settings)
    if log is None or log.first_contact is None:
        return 0.0
    contact = log.first_contact
    return math.hypot(*(contact.delta_v_1_mps, contact.delta_v_2_mps)[index])


def _plastic_delta_v(ready: _Pair, speeds_mps: tuple[float, float], index: int) -> float:
    return math.hypot(*ready.plastic(speeds_mps)[index]) if ready.closes(speeds_mps) else 0.0


def _fitted(
    delta_v: Callable[[tuple[float, float]], float], known: list[float | None], free: int, target_mps: float
) -> tuple[float, float]:
    """Return speeds of both with the free one such that the delta-v comes nearest to a target: the best of some,
    refined by halving the distance to its neighbours.
    """

    def speeds(speed_mps: float) -> tuple[float, float]:
        one, two = (speed_mps if index == free else (value or 0.0) for index, value in enumerate(known))
        return one, two

    def miss(speed_mps: float) -> float:
        return abs(delta_v(speeds(speed_mps)) - target_mps)

    apart = _FASTEST_MPS / (_TRIED - 1)
    least, best = min((miss(k * apart), k * apart) for k in range(_TRIED))
    for _ in range(_REFINED):
        apart /= 2
        for near in (best - apart, best + apart):
            if near >= 0.0 and (missed := miss(near)) < least:
                least, best = missed, near
                break
    return speeds(best)
