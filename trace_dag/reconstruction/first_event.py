"""First harmful events: the choice of the planner by kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from trace_dag.common.settings import StateSettings
from trace_dag.crash.crash_types import SIDE_OF_EVENT
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.alternatives import ambiguity_of
from trace_dag.reconstruction.analytic_hypotheses import first_contact
from trace_dag.reconstruction.course import Search
from trace_dag.reconstruction.planners.parked import parked_contacts
from trace_dag.reconstruction.planners.pedestrian import strike_hypotheses
from trace_dag.reconstruction.planners.rollover import overturn_hypotheses
from trace_dag.reconstruction.planners.run_off_road import departure_hypotheses
from trace_dag.simulation.states import Hypothesis

_BELOW_BRIDGES: Final = frozenset({3, 17, 19, 32, 34, 35, 36, 37, 41, 42})
"""SOE of what is on the ground and on no bridge, from water and boulders to trees: who came to it broke the rail."""
_STOOD_THERE: Final = frozenset({8, 9, 14, 15})
"""SOE of people and of parked vehicles: where they stood beside the road no rail was before them."""


@dataclass(frozen=True, eq=False)
class FirstEvent:
    """The ranked hypotheses of a first event, best first, at least one, and how unsure the best is (0 to 1)."""

    hypotheses: tuple[Hypothesis, ...]
    ambiguity: float


FirstPlanner: TypeAlias = Callable[[Search, StateSettings], FirstEvent]
"""A planner of the first event of a search, with the settings' lead time and at most so many hypotheses."""


def plan_first_event(search: Search, settings: StateSettings) -> FirstEvent:
    """Return the hypotheses of the first event of a search.

    Raises :class:`Rejection` (``no_feasible_state``) where none lets it happen as reported.
    """
    event = search.sequence.first
    if event.kind is EventKind.VEHICLE_CONTACT and event.parked is None:
        found, unsure = first_contact(search.scene, event, settings)
    else:
        found = _PLANNERS[event.kind](search, settings)
        unsure = ambiguity_of(found)
    return FirstEvent(tuple(_off_bridges(search.scene.record, each) for each in found), unsure)


def _off_bridges(record: CrashRecord, hypothesis: Hypothesis) -> Hypothesis:
    """Mark vehicles that must break through a bridge rail, because the report places them below it."""
    gone: set[int | None] = set()
    left: set[int | None] = set()
    for event in record.events:
        if event.code in SIDE_OF_EVENT:
            left.add(event.party_1)
        elif event.code in _BELOW_BRIDGES or (event.code in _STOOD_THERE and event.party_1 in left):
            gone.add(event.party_1)
    states = tuple(replace(s, breaks_rail=True) if s.vehicle_number in gone else s for s in hypothesis.participants)
    return replace(hypothesis, participants=states)


_PLANNERS: Final[Mapping[EventKind, Callable[[Search, StateSettings], tuple[Hypothesis, ...]]]] = {
    EventKind.VEHICLE_CONTACT: parked_contacts,
    EventKind.PERSON_STRUCK: strike_hypotheses,
    EventKind.ANIMAL_STRUCK: strike_hypotheses,
    EventKind.OBJECT_STRUCK: departure_hypotheses,
    EventKind.OVERTURN: overturn_hypotheses,
}
