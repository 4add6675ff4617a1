"""Simulation of an estimate: every kept hypothesis in the back-end of the settings, one log each."""

from __future__ import annotations

import math
from functools import lru_cache

from trace_dag.common.errors import Failure
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import Hypothesis, ParticipantState, StateEstimate
from trace_dag.simulation.types import (
    AfterStriking,
    Backend,
    BackendFactory,
    Body,
    BodyKind,
    Participant,
    SimulationLog,
    Termination,
)

_RELATIVE_FRICTION = {
    1: 1.0,  # dry
    2: 0.75,  # wet
    3: 0.35,  # snow
    4: 0.15,  # ice or frost
    5: 0.6,  # sand
    6: 0.55,  # water, standing or moving
    7: 0.4,  # oil
    10: 0.3,  # slush
    11: 0.6,  # mud, dirt or gravel
}
"""Tyre friction by ``VSURCOND`` relative to dry asphalt: middle of the ranges in Warner et al., Friction Applications
in Accident Reconstruction, SAE 830612. Surfaces the report does not name count as dry."""


_DRIVES_ON = AfterStriking(math.inf, 0.0)
"""Drivers who left by the report do not stop."""


def surface_friction(settings: SimSettings, record: CrashRecord | None) -> float:
    """Return the friction of tyres on the reported surface.

    >>> surface_friction(SimSettings(friction=0.8), None)  # dry
    0.8
    """
    return settings.friction * (relative_friction(record) if record else 1.0)


def relative_friction(record: CrashRecord) -> float:
    """Return the friction of the reported surface as a share of dry asphalt's.

    It is that of the most slippery one if vehicles report several.

    >>> relative_friction(record)  # VSURCOND 1: dry
    1.0
    """
    codes = [vehicle.surface_condition_code for vehicle in record.vehicles]
    relative = [_RELATIVE_FRICTION.get(code, 1.0) for code in codes if code is not None]
    return min(relative, default=1.0)


def participant(state: ParticipantState) -> Participant:
    """Return a party of a hypothesis as a participant of the simulation.

    >>> participant(hypothesis.participants[0]).body.mass_kg
    1600
    """
    return Participant(
        number=state.vehicle_number,
        body=Body(
            kind=BodyKind(state.kind),
            vehicle_class=state.vehicle_class,
            length_m=state.length_m,
            width_m=state.width_m,
            height_m=state.height_m,
            mass_kg=state.mass_kg,
        ),
        initial_pose=state.initial_pose,
        initial_speed_mps=state.initial_speed_mps,
        trajectory=state.trajectory,
        after_striking=_DRIVES_ON if state.drives_on else None,
        skids_from_s=math.inf if state.skids_from_s is None else state.skids_from_s,
        trailer=state.trailer,
        trailer_heading_rad=0.0 if state.trailer_heading_rad is None else float(state.trailer_heading_rad[0]),
        beyond_edge=state.beyond_edge,
        breaks_rail=state.breaks_rail,
        losses_of_control=state.losses_of_control,
    )


def participants(hypothesis: Hypothesis) -> tuple[Participant, ...]:
    """Return all parties of a hypothesis, in its order.

    >>> [each.number for each in participants(hypothesis)]
    [1, 2]
    """
    return tuple(participant(state) for state in hypothesis.participants)


def simulate(
    backend: Backend,
    network: RoadNetwork,
    xodr: bytes,
    estimate: StateEstimate,
    settings: SimSettings,
    *,
    record: CrashRecord | None = None,
) -> tuple[SimulationLog, ...]:
    """Return one log per hypothesis, in the estimate's order, on the map ``xodr`` (the same map as ``network``).

    ``record`` gives the road's surface; without it the road is dry. All hypotheses are simulated, so that thresholds of
    the verdict can change without simulating again. Raises :class:`trace_dag.common.errors.Failure` for an estimate
    that cannot be driven, or if no hypothesis stayed within all bounds. Vehicles that do not meet are no error: the run
    ends with that reason in its log.
    """
    simulation = backend.load(network, xodr, friction=surface_friction(settings, record))
    logs = tuple(
        simulation.run(participants(hypothesis), time_limit_s=settings.time_limit_s, objects=hypothesis.objects)
        for hypothesis in estimate.hypotheses
    )
    if logs and all(log.termination is Termination.DIVERGED for log in logs):
        raise Failure(f"{estimate.key}: no hypothesis could be simulated; the first: {logs[0].reason}")
    return logs


# --- back-ends -------------------------------------------------------------------------------------------------------
def backend_factory(settings: SimSettings) -> BackendFactory:
    """Return the factory of the back-end.

    Raises :class:`trace_dag.common.errors.UserError` if it cannot be loaded.

    >>> type(backend_factory(SimSettings(backend="embedded"))(SimSettings())).__name__
    'EmbeddedBackend'
    """
    factory: BackendFactory = load(PluginKind.BACKEND, settings.backend)
    return factory


@lru_cache(maxsize=1)
def backend(settings: SimSettings) -> Backend:
    """Return the back-end, connected once per process.

    Other back-ends are not imported.

    >>> type(backend(SimSettings(backend="embedded"))).__name__
    'EmbeddedBackend'
    """
    return backend_factory(settings)(settings)
