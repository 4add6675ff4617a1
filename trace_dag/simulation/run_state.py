"""The state of a run for its components: bodies, clock, and steps."""

from __future__ import annotations

from typing import Protocol

from trace_dag.common.settings import SimSettings
from trace_dag.simulation.driver_response import DriverResponse
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.people import Person
from trace_dag.simulation.recorder import ContactEpisode
from trace_dag.simulation.rigid import BodyStates, RigidBodies
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.towing import Hitch
from trace_dag.simulation.types import Participant
from trace_dag.simulation.vehicle_pairs import VehiclePairs


class RunState(Protocol):
    """A run under way; :class:`trace_dag.simulation.crash_run.CrashRun` documents each member."""

    settings: SimSettings
    step_s: float
    parts: int
    friction: float
    surface: Surface
    participants: tuple[Participant, ...]
    vehicles: list[Vehicle]
    people: list[Person]
    hitches: list[Hitch]
    wheels: DriverResponse
    pairs: VehiclePairs
    bodies: RigidBodies
    open: dict[tuple[int, int], ContactEpisode]
    state: BodyStates | None
    before: BodyStates | None

    def taken_over(self) -> BodyStates:
        """Return the present state, which MuJoCo has from here on."""

    def update(self, positions: list[float], rates: list[float]) -> None:
        """Apply a state from MuJoCo to the bodies."""

    def move_alone(self, forces: list[tuple[float, float, float]]) -> None:
        """Take a step without any contact."""

    def contact_possible(self, step: int) -> bool:
        """Return whether bodies may touch within the next step."""

    def forces_now(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """Return the forces on the vehicles in a part of a step."""

    def held(self, forces: list[float], part_s: float) -> list[float]:
        """Return the given forces plus those of the hitches."""

    def step_in_parts(self, step: int, forces: list[float], parts: int) -> None:
        """Take a step in a number of parts."""

    def step_leaning(self, step: int, forces: list[float]) -> None:
        """Take a whole step of bodies that lean on each other."""

    def watch_contacts(self, time_s: float) -> None:
        """Look at the contacts that are open."""

    def close_ended(self, now_s: float) -> None:
        """Close the contacts that are over."""

    def begin(
        self, pair: tuple[int, int], before: BodyStates, now: BodyStates, before_s: float, part_s: float
    ) -> ContactEpisode:
        """Return a contact that began between two states."""
