"""Drivers after a contact.

A crash ends the drive: nobody steers or brakes from then on. A change of a vehicle's velocity below the threshold of
event data recorders (``sim.crash_delta_v_mps``, 8 km/h: 49 CFR 563.5) is no crash to its driver. The driver then reacts
as to a struck person: keeps the planned path, and brakes after a reaction time. A motorcycle falls at any touch.

The reaction to a person begins when the person enters the vehicle's lane (reaction times are measured from the
appearance of an obstacle: Olson and Sivak, Human Factors 28, 1986). It ends at the strike at the earliest, since
earlier braking is part of the plan. A person who was in the lane all along was not seen until struck.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.parties import party_of_body
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.people import Person
from trace_dag.simulation.recorder import ContactEpisode
from trace_dag.simulation.types import AfterStriking, Participant
from trace_dag.simulation.vehicles import vehicle_model


class DriverResponse:
    """The reactions of a run's drivers, and their lasting loss of control.

    Vehicles ``led_by`` agents end their drive at any contact.
    """

    def __init__(
        self, participants: Sequence[Participant], settings: SimSettings, friction: float, *, led_by: Collection[int]
    ) -> None:
        braking_mps2 = settings.braking_share * friction * GRAVITY_MPS2
        self._step_s, self._crash_delta_v_mps = settings.step_s, settings.crash_delta_v_mps
        self._reactions: dict[int, AfterStriking] = {}
        self._lost = set(led_by)
        for each in participants:
            if each.body.is_figure:
                continue
            grip = vehicle_model(each.body, each.trailer).tyre_grip
            usual = AfterStriking(settings.reaction_s, braking_mps2 * grip)
            self._reactions[each.number] = each.after_striking or usual
            if each.body.vehicle_class is VehicleClass.MOTORCYCLE or each.skids_from_s < math.inf:
                self._lost.add(each.number)

    def lose(self, vehicle: Vehicle) -> None:
        """Remove the driver of the vehicle."""
        vehicle.crashed = True
        self._lost.add(party_of_body(vehicle.number))

    def react(self, vehicle: Vehicle, since_s: float, *, seen_for_s: float = 0.0, beside: bool = False) -> None:
        """Start a driver's reaction to an event that had been in sight for ``seen_for_s``.

        A vehicle pushed ``beside`` its path stays there.
        """
        reaction = self._reactions[party_of_body(vehicle.number)]
        reaction = replace(reaction, reaction_s=max(reaction.reaction_s - seen_for_s, 0.0))
        vehicle.strike(round(since_s / self._step_s), reaction, self._step_s, beside=beside)

    def is_crash(self, impulse_ns: float, mass_kg: float) -> bool:
        """Return whether an impulse is a crash to a vehicle of that mass."""
        return impulse_ns / mass_kg >= self._crash_delta_v_mps

    def after(self, episode: ContactEpisode, under_way: Iterable[ContactEpisode]) -> None:
        """Decide which drivers go on driving after a contact of two vehicles, while others may be under way."""
        touching = {party_of_body(each.number) for other in under_way for each in (other.one, other.two)}
        for vehicle, mass_kg in zip((episode.one, episode.two), episode.masses_kg, strict=True):
            if isinstance(vehicle, Person):
                continue
            tips = vehicle.roll is not None and vehicle.roll.roll_rad != 0.0
            if tips or self.is_crash(episode.impulse_ns, mass_kg):
                self.lose(vehicle)
            if party_of_body(vehicle.number) not in self._lost | touching:
                vehicle.crashed = False
                self.react(vehicle, episode.start_s, beside=True)
