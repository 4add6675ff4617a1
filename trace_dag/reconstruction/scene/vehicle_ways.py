"""Ways of a vehicle past the crash, each with its speed and the evidence for it, whatever it meets there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.motion.manoeuvres import (
    Option,
    back_up,
    follows_turn,
    keep_lane,
    make_turn,
)
from trace_dag.reconstruction.motion.path_pairs import speed_of, turning_approaches
from trace_dag.reconstruction.motion.speeds import TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene


def approaches_of(
    scene: Scene, who: Party, *, approaches: Sequence[Approach] | None = None
) -> Iterator[tuple[Option, TravelSpeed, evidence.Terms]]:
    """Yield the options of a vehicle regardless of the person, each with its speed and evidence.

    ``approaches`` are the approaches to try; by default those that fit its turn and the place of the crash.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> who = party(record, record.vehicles[1])
    >>> {option.manoeuvre.value for option, _, _ in approaches_of(scene, who, approaches=scene.through[:1])}
    {'straight'}
    """
    for approach in _approaches(scene, who) if approaches is None else approaches:
        speed = speed_of(who, approach)
        for option in _options(who, approach, speed.speed_mps):
            yield option, speed, way_terms(scene, who, option, speed)


def _approaches(scene: Scene, who: Party) -> list[Approach]:
    if who.turn is None or who.backing:
        return scene.on_road(scene.through)
    following = [approach for approach in scene.approaches if follows_turn(approach, who.turn)]
    turning = turning_approaches(scene.approaches, who.turn)
    found = {approach.name: approach for approach in (*following, *turning, *scene.on_road(scene.through))}
    return list(found.values())  # a vehicle can turn where the map has no lanes for it: into a driveway


def _options(who: Party, approach: Approach, speed_mps: float) -> list[Option]:
    if who.backing:
        return [back_up(approach, speed_mps)]
    if who.turn is None or follows_turn(approach, who.turn):
        return [keep_lane(approach, who.vehicle, speed_mps, turn=who.turn)]
    return make_turn(approach, who.vehicle, speed_mps, who.turn, slides=True)


def way_terms(scene: Scene, who: Party, option: Option, speed: TravelSpeed) -> evidence.Terms:
    """Return the evidence for one way of a vehicle, as log-likelihoods."""
    keeps_on = [] if who.turn or who.backing else [option.approach]
    first_street = evidence.first_street_terms(scene, keeps_on)
    return vehicle_terms(scene, who, option, speed) | _named(first_street, who)


def vehicle_terms(scene: Scene, who: Party, option: Option, speed: TravelSpeed) -> evidence.Terms:
    """Return the evidence for one way of a vehicle, without what the street of the crash says of all its vehicles."""
    approach = option.approach
    terms = {
        **evidence.street_terms(scene.network, scene.placement, scene.record, approach),
        **evidence.road_terms(who.vehicle, approach),
        **evidence.lane_terms(who.vehicle, approach, who.turn),
        **evidence.speed_terms(who.vehicle, approach, who.turn),
        **evidence.driveway_speed_terms(approach, speed.speed_mps),
        **evidence.heading_terms(who.vehicle, option),
        **option.costs,
    }
    return _named(terms, who)


def _named(terms: evidence.Terms, who: Party) -> evidence.Terms:
    return {f"{name} (vehicle {who.vehicle.number})": value for name, value in terms.items()}
