"""Inputs of a change beside the report itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord


@dataclass(frozen=True)
class Point:
    """A place on a road, WGS84 degrees: how far from the crash, the names of its street, and whether that is the
    crash's street."""

    latitude_deg: float
    longitude_deg: float
    distance_m: float
    names: tuple[str, ...]
    same_street: bool


@dataclass(frozen=True, eq=False)
class PerturbedScene:
    """The crash as reported (``record``), the draws (``rng``), and the place drawn for it (``point``), if one is.

    ``record`` stays that of the crash perturbed, where it is another crash's report that is changed.
    """

    record: CrashRecord
    rng: np.random.Generator
    point: Point | None = None

    @property
    def vehicles(self) -> tuple[int, ...]:
        """Return numbers of the vehicles it is about: the pair that collided, or those that struck people, in order."""
        sequence = sequence_of(self.record)
        if sequence.first.kind is EventKind.PERSON_STRUCK:
            return tuple(dict.fromkeys(event.vehicle.number for event in sequence.contacts))
        return self.pair

    @property
    def pair(self) -> tuple[int, int]:
        """Return numbers of the two vehicles that collided, in order.

        Raises ``ValueError`` if the record has none.
        """
        pair = self.record.colliding_vehicles
        if pair is None:
            raise ValueError(f"{self.record.key}: no two vehicles collided")
        one, two = sorted(vehicle.number for vehicle in pair)
        return one, two
