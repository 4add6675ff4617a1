"""The estimator of crashes of three and more vehicles, and of those with parked ones: contact after contact.

The first contact is estimated as that of any two vehicles. Then the next vehicle is looked for: what came before is
simulated, and :mod:`trace_dag.estimators.arrivals` finds where it has to stand, or when it has to come, to touch the
reported party on the reported areas. What touches then is simulated again, and so on. The simulator's own settings are
the usual ones here, whatever those of the simulation are: an estimate follows from the record and the map.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.contacts import VehicleContact, contacts_of, order_is_told, untold_contact
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Reason, Rejection
from trace_dag.estimators.arrivals import LONGEST_WAIT_S, Arrival, SimulatedMotion, arrivals
from trace_dag.estimators.usual_simulation import USUAL, usual_simulation
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import StateSettings
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.order import ContactOrder, comes_in_order, in_order
from trace_dag.sim.run import participant
from trace_dag.sim.run_of_vehicles import VehicleRun
from trace_dag.sim.types import SimulationLog
from trace_dag.states.analytic import NAME, VERSION, build_scene, parties, ranked, solve_all
from trace_dag.states.assemble import AFTER_IMPACT_M, AFTER_IMPACT_S, driven
from trace_dag.states.candidates import candidates
from trace_dag.states.encounters import encounters
from trace_dag.states.parked import parked_contacts
from trace_dag.states.ranking import ambiguity, leaders_first
from trace_dag.states.scene import Scene
from trace_dag.states.types import (
    EstimateCheck,
    EstimatorRun,
    Hypothesis,
    ParticipantState,
    PlannedEvent,
    StateEstimate,
)
from trace_dag.units import bearing_to_clock_h
from trace_dag.wording import counted

_FIRST_CONTACTS: Final = 6  # hypotheses of the first contact that are gone on from
_TRIED: Final = 6  # arrivals of one vehicle that are simulated
_FOLLOWED: Final = 2  # of those that touch as reported, how many are gone on from
_DECIMALS: Final = 6


@dataclass(frozen=True, eq=False)
class _Chain:
    """The crash as far as it is planned: who takes part, what that comes to, and why it is likely."""

    participants: tuple[ParticipantState, ...]
    run: VehicleRun
    log: SimulationLog
    order: ContactOrder
    score: float
    names: tuple[str, ...]
    evidence: dict[str, float]

    @property
    def numbers(self) -> frozenset[int]:
        """Numbers of those who take part."""
        return frozenset(state.vehicle_number for state in self.participants)

    @property
    def rank(self) -> tuple[int, int, float]:
        """More of the contacts first, then fewer that nobody reported, then the likelier."""
        return -self.order.happened, len(self.order.strange), -round(self.score, _DECIMALS)


@dataclass(frozen=True, eq=False)
class _Crash:
    """What is known of the crash throughout."""

    scene: Scene
    contacts: tuple[VehicleContact, ...]
    told: bool
    simulation: EmbeddedSimulation
    time_limit_s: float

    def simulated(
        self,
        participants: tuple[ParticipantState, ...],
        planned: int,
        score: float,
        names: tuple[str, ...],
        evidence: dict[str, float],
    ) -> _Chain:
        """The chain of these participants, by whom so many of the contacts are to happen, up to one that is strange."""
        run = self.simulation.begin(tuple(map(participant, participants)), time_limit_s=self.time_limit_s)
        expected = self.expected(planned)
        log = run.log(as_long_as=lambda so_far: comes_in_order(so_far, expected, told=self.told))
        order = in_order(log.contacts, expected, told=self.told)
        return _Chain(participants, run, log, order, score, names, evidence)

    def to_the_end(self, chain: _Chain, planned: int) -> _Chain:
        """The chain simulated to its end."""
        log = chain.run.log()
        chain.run.release()
        return replace(chain, log=log, order=in_order(log.contacts, self.expected(planned), told=self.told))

    def expected(self, planned: int) -> list[tuple[int, int]]:
        """The pairs of the first so many contacts."""
        return [contact.pair for contact in self.contacts[:planned]]


def estimate_contacts(
    record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings
) -> StateEstimate:
    """The ranked hypotheses of a crash of several contacts, best first: those in which more of them happen, in order.

    Raises :class:`Rejection` (``no_feasible_state``) where the first two cannot meet as reported, or a later vehicle
    cannot come to touch its party.
    """
    contacts = contacts_of(record)
    if not contacts:
        raise Rejection(Reason.NO_FEASIBLE_STATE, untold_contact(record) or "no contact of vehicles in the record")
    scene = build_scene(record, network, report, lead_time_s=settings.lead_time_s + LONGEST_WAIT_S)
    simulation = usual_simulation(network, record)
    crash = _Crash(scene, contacts, order_is_told(record), simulation, USUAL.time_limit_s)
    firsts = _first_contacts(scene, contacts[0], settings)
    begun = (
        crash.simulated(first.participants, 1, first.score, (first.name,), dict(first.evidence)) for first in firsts
    )
    chains = [crash.to_the_end(chain, 1) for chain in begun]
    whole: list[tuple[_Chain, Hypothesis]] = []
    stuck: list[str] = []
    for first, chain in zip(firsts, chains, strict=True):
        followed = [chain]
        for place in range(1, len(contacts)):
            followed = [after for chain in followed for after in _followed(crash, chain, place, stuck)]
            followed = sorted(followed, key=lambda chain: chain.rank)[:_FOLLOWED]
        whole += [(chain, _hypothesis(crash, chain, first, settings.lead_time_s)) for chain in followed]
    if not whole:
        raise Rejection(Reason.NO_FEASIBLE_STATE, stuck[0] if stuck else _no_first(scene, contacts[0]), measured=0.0)
    whole.sort(key=lambda each: (*each[0].rank[:2], _failed(each[1]), each[0].rank[2], each[1].name))
    best = whole[0][0].score
    unsure = ambiguity(best, (min(chain.score, best) for chain, _ in whole))
    kept = tuple(hypothesis for _, hypothesis in whole[: settings.max_hypotheses])
    return StateEstimate(record.key, kept, EstimatorRun(NAME, VERSION), unsure)


def _first_contacts(scene: Scene, contact: VehicleContact, settings: StateSettings) -> tuple[Hypothesis, ...]:
    most = max(settings.max_hypotheses, _FIRST_CONTACTS)
    if not all(vehicle.in_transport for vehicle, _ in contact.sides):
        return parked_contacts(scene, contact, lead_time_s=settings.lead_time_s, most=most)
    readings = encounters(scene.record, *parties(scene.record))
    found = [candidate for reading in readings for candidate in candidates(scene, reading)]
    wanted = settings.model_copy(update={"max_hypotheses": most})
    return ranked(scene, solve_all(scene, found), wanted)[0]


def _no_first(scene: Scene, contact: VehicleContact) -> str:
    one, two = contact.pair
    return scene.no_way_that(f"lets vehicles {one} and {two} meet first, as event {contact.event_number} says")


# --- one contact more ------------------------------------------------------------------------------------------------
def _followed(crash: _Crash, chain: _Chain, place: int, stuck: list[str]) -> list[_Chain]:
    """The chain with one contact more: as it is where both are there already, else with the vehicle that is missing.

    Where none of its arrivals comes to the contact in simulation, the likeliest is kept: a verdict says what it lacks.
    """
    contact = crash.contacts[place]
    newcomers = [number for number in contact.pair if number not in chain.numbers]
    planned = place + 1
    if not newcomers:
        return [replace(chain, order=in_order(chain.log.contacts, crash.expected(planned), told=crash.told))]
    if len(newcomers) == 2:
        one, two = contact.pair
        stuck.append(f"event {contact.event_number}: neither vehicle {one} nor {two} had met another before")
        return []
    found = arrivals(
        crash.scene, contact, newcomers[0], _motions(chain.log), after_s=_last_contact_s(chain, place, crash.told)
    )
    tried: list[_Chain] = []
    good: list[_Chain] = []
    for arrival in leaders_first(found, lambda arrival: arrival.group)[:_TRIED]:
        tried.append(_joined(crash, chain, arrival, planned))
        if tried[-1].order.happened == planned and not tried[-1].order.strange:
            good.append(tried[-1])
        if len(good) == _FOLLOWED:
            break
    if not tried:
        (known,) = (number for number in contact.pair if number != newcomers[0])
        ways = counted(len(crash.scene.streams), "way")
        stuck.append(
            f"event {contact.event_number}: on none of {ways} past the crash vehicle {newcomers[0]} comes to touch "
            f"vehicle {known} after what was before"
        )
    if not good:
        return sorted((crash.to_the_end(each, planned) for each in tried), key=lambda each: each.rank)[:1]
    for each in tried:
        each.run.release()
    return good


def _last_contact_s(chain: _Chain, place: int, told: bool) -> float:
    """When the contact before came about, or the first one where the order is not told."""
    times = [contact.time_s for contact in chain.order.matched[:place] if contact is not None]
    return (max(times) if told else min(times)) if times else chain.participants[0].trajectory.time_s[0]


def _motions(log: SimulationLog) -> list[SimulatedMotion]:
    return [
        SimulatedMotion.of(each, log.bodies[each.number].length_m, log.bodies[each.number].width_m)
        for each in log.vehicles
    ]


def _joined(crash: _Crash, chain: _Chain, arrival: Arrival, planned: int) -> _Chain:
    vehicle = arrival.who.vehicle
    after_s = max(AFTER_IMPACT_S, AFTER_IMPACT_M / max(arrival.profile.impact_mps, AFTER_IMPACT_M / LONGEST_WAIT_S))
    state = driven(
        crash.scene.network,
        vehicle,
        arrival.placed.option,
        arrival.placed.path,
        arrival.placed.station_m,
        arrival.speed,
        arrival.profile,
        lead_time_s=arrival.time_s,
        after_s=after_s,
    )
    state = replace(state, impact_clock_h=round(bearing_to_clock_h(arrival.placed.bearing_rad), 3))
    return crash.simulated(
        (*chain.participants, state),
        planned,
        chain.score + arrival.score,
        (*chain.names, arrival.name),
        chain.evidence | {f"arrival of vehicle {vehicle.number}": round(arrival.score, _DECIMALS)},
    )


# --- hypotheses ------------------------------------------------------------------------------------------------------
def _hypothesis(crash: _Crash, chain: _Chain, first: Hypothesis, lead_s: float) -> Hypothesis:
    planned, checks = [], list(first.checks)
    states = {state.vehicle_number: state for state in chain.participants}
    for contact, seen in zip(crash.contacts, chain.order.matched, strict=True):
        one, two = contact.one.number, contact.two.number
        name = f"contact of event {contact.event_number}"
        if seen is None:
            time_s, xy_m = lead_s, first.impact_point_xy_m if contact is crash.contacts[0] else _place(states[two])
            checks.append(EstimateCheck(name, False, f"vehicles {one} and {two} do not touch in their turn"))
        else:
            time_s, xy_m = seen.time_s, (seen.x_m, seen.y_m)
            checks.append(EstimateCheck(name, True, f"vehicles {one} and {two} touch at {seen.time_s:.2f} s"))
        where = (round(xy_m[0], _DECIMALS), round(xy_m[1], _DECIMALS))
        planned.append(PlannedEvent(contact.event_number, one, two, round(time_s, _DECIMALS), where))
    return Hypothesis(
        name="; ".join(chain.names),
        score=round(chain.score, _DECIMALS),
        evidence=chain.evidence,
        participants=tuple(sorted(chain.participants, key=lambda state: state.vehicle_number)),
        impact_time_s=lead_s,
        impact_point_xy_m=first.impact_point_xy_m,
        checks=tuple(checks),
        planned=tuple(planned),
    )


def _failed(hypothesis: Hypothesis) -> int:
    return sum(not check.passed for check in hypothesis.checks)


def _place(state: ParticipantState) -> tuple[float, float]:
    return state.impact_pose.x_m, state.impact_pose.y_m
