"""Bodies of people for the simulation, from their age and sex (:mod:`trace_dag.simulation.body_sizes`)."""

from __future__ import annotations

from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.body_sizes import BICYCLE_KG, BICYCLE_LENGTH_M, CONVEYANCE_KG, person_size
from trace_dag.simulation.types import Body, BodyKind


def person_body(kind: BodyKind, age_years: float | None = None, *, female: bool | None = None) -> Body:
    """Return the body of a person of an age (years) and sex, with the mount.

    ``height_m`` is the stature, ``mass_kg`` that of the person with the bicycle or conveyance; length and width are
    those of the outline on the road until the person is touched.
    """
    size = person_size(PartyKind(kind), age_years, female=female)
    return Body(kind, VehicleClass.OTHER, size.length_m, size.width_m, size.stature_m, size.mass_kg)


def ridden_kg(body: Body) -> float:
    """Return the mass of a person's mount, which is part of the body's mass, at most half.

    >>> ridden_kg(Body(BodyKind.CYCLIST, VehicleClass.OTHER, 1.75, 0.6, 1.75, 90.0))  # a bicycle for adults
    15.0
    """
    if body.kind is BodyKind.CYCLIST:
        return min(BICYCLE_KG * body.length_m / BICYCLE_LENGTH_M, body.mass_kg / 2)
    if body.kind is BodyKind.CONVEYANCE:
        return min(CONVEYANCE_KG, body.mass_kg / 2)
    return 0.0
