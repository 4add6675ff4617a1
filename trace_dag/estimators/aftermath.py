"""What vehicles strike after a contact, and whether they overturn: placed and looked for in the order of the events.

Nobody drives after a crash of vehicles, and who strikes an animal drives on: where a vehicle goes is simulated, with
the ground beyond the edge and with the usual settings. If it does not leave the road as reported it is taken to be out
of control with its front wheels turned, by as little as leads it off the road to the reported side: what led it there
is not reported.

The object of an event is put where that way has come as far beyond the edge of the carriageway as such objects usually
stand, or as far as the vehicle gets, outside the spot of the area of impact, or of the part that goes first where none
is reported. An object of the kind that the map has on its way is used instead. Then it is simulated with the object,
and the next event is looked for. An object that another party would strike, or that would change who meets whom, is
left out. The hypothesis says what came of each event.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, product
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from trace_dag.crash.aftermath import Afterwards, aftermath_of
from trace_dag.crash.departures import DepartureSide, ObjectStruck
from trace_dag.crash.derive import impact_area
from trace_dag.crash.record import CrashRecord, ImpactArea, VehicleClass
from trace_dag.estimators.usual_simulation import USUAL, usual_simulation
from trace_dag.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.roads.map.areas import Area
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import roadside_at
from trace_dag.roads.report import MappedThing, MapReport
from trace_dag.sim.embedded import EmbeddedSimulation
from trace_dag.sim.leaving_road import left_road_after_contact
from trace_dag.sim.order import pair_of
from trace_dag.sim.run import participant
from trace_dag.sim.types import PULSE_S, Body, Contact, SimulationLog, VehicleLog, overturned_at
from trace_dag.states.leaving import SIGN
from trace_dag.states.mapped_objects import nearest_of, things_of_kind
from trace_dag.states.object_extent import clear_of_roadways
from trace_dag.states.objects import KINDS, FixedObject, ObjectForm
from trace_dag.states.placing import as_mapped, placed
from trace_dag.states.spots import spots_of
from trace_dag.states.types import EstimateCheck, Hypothesis, ParticipantState, StateEstimate, TurnedWheels
from trace_dag.units import bearing_to_clock_h

_REACH_M: Final = 250.0  # farther from a contact nobody slides
_CREEPS_MPS: Final = 0.5
_MEETS: Final = 0.1  # a face that moves so little ahead strikes nothing
_NEAREST_M: Final = 0.1  # beyond the edge
_SHORT_M: Final = 10.0
_MOST_OF_A_WAY: Final = 4  # places for an object that are simulated
_TURNED_DEG: Final = (1.0, 2.0, 4.0)  # of front wheels: the least that leads off the road is taken
_NEARER: Final = (1.0, 0.5, 0.2)  # of the usual distance beyond the edge


def with_aftermath(
    estimate: StateEstimate, record: CrashRecord, network: RoadNetwork, report: MapReport
) -> StateEstimate:
    """The estimate with what the report has after a contact; as it is where the report has nothing of that.

    It is looked for in the best hypothesis alone, which is the accepted one of all 89 verified crashes of several
    vehicles at hand. All of them take place on the same ground.
    """
    later = aftermath_of(record)
    if not later:
        return estimate
    best, *others = (_off_the_road(hypothesis, later) for hypothesis in estimate.hypotheses)
    run = _Run(network, report.things, usual_simulation(network, record))
    return replace(estimate, hypotheses=(_followed(best, later, run), *others))


@dataclass(frozen=True, eq=False)
class _Course:
    """A crash as it goes on with some objects: who takes part, what stands there, and what comes of it.

    ``turned`` has the courses in which a vehicle has its wheels turned, for every event that asks for them.
    """

    states: tuple[ParticipantState, ...]
    objects: tuple[FixedObject, ...]
    log: SimulationLog
    turned: dict[tuple[int, TurnedWheels], _Course] = field(default_factory=dict)


def _off_the_road(hypothesis: Hypothesis, later: Sequence[Afterwards]) -> Hypothesis:
    gone = {each.vehicle.number for each in later}
    states = tuple(replace(s, beyond_edge=True) if s.vehicle_number in gone else s for s in hypothesis.participants)
    return replace(hypothesis, participants=states)


def _followed(hypothesis: Hypothesis, later: Sequence[Afterwards], run: _Run) -> Hypothesis:
    """A hypothesis with what comes after its contacts."""
    course = run.simulated(hypothesis.participants, ())
    checks = []
    for event in later:
        course, check = run.overturned(course, event) if event.struck is None else run.struck(course, event)
        checks.append(check)
    return replace(hypothesis, participants=course.states, objects=course.objects, aftermath=tuple(checks))


@dataclass(frozen=True, eq=False)
class _Run:
    """The map, what stands beside its roads, and the simulation on it."""

    network: RoadNetwork
    things: Sequence[MappedThing]
    simulation: EmbeddedSimulation

    def simulated(
        self,
        states: tuple[ParticipantState, ...],
        objects: tuple[FixedObject, ...],
        as_long_as: Callable[[Sequence[Contact]], bool] | None = None,
    ) -> _Course:
        """What comes of these participants with these objects, as long as the contacts are as asked for."""
        parties = tuple(map(participant, states))
        log = self.simulation.run(parties, time_limit_s=USUAL.time_limit_s, objects=objects, as_long_as=as_long_as)
        return _Course(states, objects, log)

    def struck(self, course: _Course, event: Afterwards) -> tuple[_Course, EstimateCheck]:
        """The course with one object more, or as it is; and what came of it."""
        assert event.struck is not None
        number, why_not = event.vehicle.number, ""
        since_s = _since_s(course.log, number)
        if since_s is None:
            return course, EstimateCheck(event.name, False, f"vehicle {number} meets nobody before it")
        for on_its_way, turned in self._ways(course, event, since_s):
            way = _Way.of(self, on_its_way.log, number, since_s)
            why_not = why_not or way.why_not(event.side)
            for item in islice(way.candidates(event, event.struck), _MOST_OF_A_WAY):
                object_struck = _ObjectStruck(item, number, since_s, _order(course.log.contacts))
                objects = (*on_its_way.objects, item)
                tried = self.simulated(on_its_way.states, objects, object_struck.may_come_right)
                wrong = object_struck.wrong(tried.log.contacts)
                if wrong is None:
                    struck_s = tried.log.strikes_of(item.number)[0].time_s
                    detail = f"vehicle {number} strikes the {item.name} at {struck_s:.2f} s{turned}"
                    return tried, EstimateCheck(event.name, True, detail)
                why_not = wrong
        return course, EstimateCheck(event.name, False, why_not)

    def overturned(self, course: _Course, event: Afterwards) -> tuple[_Course, EstimateCheck]:
        """The course in which the vehicle overturns, if one of its ways leads to that; and what came of it."""
        number = event.vehicle.number
        since_s = _since_s(course.log, number)
        if since_s is None:
            return course, EstimateCheck(event.name, False, f"vehicle {number} meets nobody before it")
        order = _order(course.log.contacts)
        for tried, turned in self._ways(course, event, since_s):
            overturns = overturned_at(tried.log.vehicle_log(number)) is not None
            if overturns and _order(tried.log.contacts) == order:
                return tried, EstimateCheck(event.name, True, f"vehicle {number} overturns{turned}")
        return course, EstimateCheck(event.name, False, f"vehicle {number} stays on its wheels")

    def _ways(self, course: _Course, event: Afterwards, since_s: float) -> Iterator[tuple[_Course, str]]:
        """The courses with the ways that the vehicle can have gone on, each with what is assumed for it: as its wheels
        roll, then with front wheels turned ever more to the side to which it left the road."""
        yield course, ""
        state = next(each for each in course.states if each.vehicle_number == event.vehicle.number)
        if state.turned_wheels is not None or state.vehicle_class is VehicleClass.MOTORCYCLE:
            return
        from_s = round(since_s + PULSE_S, 6)
        for turned_deg, side in product(_TURNED_DEG, (DepartureSide.RIGHT, DepartureSide.LEFT)):
            if event.side not in (side, None) or (event.side is None and event.struck is None):
                continue
            angle_rad = round(SIGN[side] * math.radians(turned_deg), 6)
            wheels = TurnedWheels(from_s, angle_rad)
            known = course.turned.get((state.vehicle_number, wheels))
            if known is None:
                turned = replace(state, turned_wheels=wheels)
                states = tuple(turned if each is state else each for each in course.states)
                known = course.turned[state.vehicle_number, wheels] = self.simulated(states, course.objects)
            yield known, f", taken to be out of control, its front wheels turned by {turned_deg:g}° to the {side}"


def _since_s(log: SimulationLog, number: int) -> float | None:
    """When a vehicle last came into a contact; None if it did not."""
    return max((c.time_s for c in log.contacts if number in (c.number_1, c.number_2)), default=None)


@dataclass(frozen=True, eq=False)
class _ObjectStruck:
    """That a vehicle strikes an object after a time, and nothing else changes: ``order`` is who met whom without it."""

    item: FixedObject
    number: int
    since_s: float
    order: list[tuple[int, int]]

    def spoilt(self, contacts: Sequence[Contact]) -> str | None:
        """What the contacts so far have that the report does not say; nothing that comes later mends it."""
        struck = sorted((each for each in contacts if each.number_2 == self.item.number), key=lambda each: each.time_s)
        other = next((contact.number_1 for contact in struck if contact.number_1 != self.number), None)
        name = self.item.name
        if other is not None:
            return f"vehicle {other} would strike the {name} of event {self.item.event_number} too"
        if struck and struck[0].time_s < self.since_s:
            return f"vehicle {self.number} would strike the {name} before what came before it"
        others = self._order_of_others(contacts)
        if others != self.order[: len(others)]:
            return self._changed()
        return None

    def may_come_right(self, contacts: Sequence[Contact]) -> bool:
        """Whether nothing in the contacts so far spoils it."""
        return self.spoilt(contacts) is None

    def wrong(self, contacts: Sequence[Contact]) -> str | None:
        """What all contacts of a run lack or have too many of; None if the object is struck as it has to be, and no
        more."""
        spoilt = self.spoilt(contacts)
        if spoilt is not None:
            return spoilt
        if not any(contact.number_2 == self.item.number for contact in contacts):
            return f"vehicle {self.number} does not come to touch the {self.item.name} that was placed for it"
        return None if self._order_of_others(contacts) == self.order else self._changed()

    def _order_of_others(self, contacts: Sequence[Contact]) -> list[tuple[int, int]]:
        return [pair for pair in _order(contacts) if self.item.number not in pair]

    def _changed(self) -> str:
        return f"who meets whom would change by the {self.item.name} of event {self.item.event_number}"


def _order(contacts: Sequence[Contact]) -> list[tuple[int, int]]:
    """Who comes to touch whom or what, in order."""
    return list(dict.fromkeys(pair_of(contact) for contact in sorted(contacts, key=lambda each: each.time_s)))


# --- the way of one vehicle ------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class _Way:
    """Where a vehicle goes after its last contact: the steps of its log in which it moves, its pose at each of them,
    and how far beyond the edge its four corners are (shape (k, 4), m, negative within it)."""

    network: RoadNetwork
    area: Area
    log: SimulationLog
    driven: VehicleLog
    body: Body
    steps: NDArray[np.intp]
    poses: tuple[Pose, ...]
    beyond_m: FloatArray
    outlines: NDArray[np.object_]
    things: Sequence[MappedThing]

    @classmethod
    def of(cls, run: _Run, log: SimulationLog, number: int, since_s: float) -> _Way:
        """That of a vehicle of a log."""
        network = run.network
        driven = log.vehicle_log(number)
        body = log.bodies[number]
        moves = np.hypot(driven.velocity_x_mps, driven.velocity_y_mps) >= _CREEPS_MPS
        steps = np.flatnonzero((driven.time_s > since_s) & moves)
        steps = steps if len(steps) else np.array([len(driven.time_s) - 1])
        columns = np.stack([driven.x_m, driven.y_m, driven.heading_rad, driven.z_m], axis=-1)[steps]
        poses = tuple(Pose(*map(float, row)) for row in columns)
        area = network.carriageway_near(poses[0].x_m, poses[0].y_m, _REACH_M, z_m=poses[0].z_m)
        corners = np.concatenate([rectangle_corners(pose, body.length_m, body.width_m) for pose in poses])
        beyond_m = area.beyond_m(corners[:, 0], corners[:, 1]).reshape(-1, 4)
        outlines = np.asarray(shapely.polygons(corners.reshape(-1, 4, 2)))
        return cls(network, area, log, driven, body, steps, poses, beyond_m, outlines, run.things)

    def candidates(self, event: Afterwards, struck: ObjectStruck) -> Iterator[FixedObject]:
        """Objects that the vehicle would strike on its way: first as far beyond the edge as is usual, then nearer."""
        usual_m = KINDS[struck.code].beyond_edge_m
        touches = self._touches(struck)
        beyond_m = np.array([beyond for beyond, _ in touches])
        farthest_m = float(beyond_m.max(initial=0.0))
        line = KINDS[struck.code].form is ObjectForm.LINE
        for k, thing in self._mapped(struck.code):
            if self._left_to(event.side, k):
                _, runs_rad = nearest_of(thing, self.poses[k].xy_m)
                yield as_mapped(self._placed(event, touches[k][1], k, runs_rad), thing)
        wanted = [share * usual_m for share in _NEARER] + [farthest_m]
        steps = [int(np.argmax(beyond_m >= each)) for each in wanted if _NEAREST_M <= each <= farthest_m]
        for k in dict.fromkeys(steps):
            if not self._left_to(event.side, k):
                continue
            yield self._placed(event, touches[k][1], k, None)
            if line:  # another vehicle would perhaps come against a long one
                yield self._placed(event, touches[k][1], k, None, length_m=_SHORT_M)

    def _placed(
        self, event: Afterwards, struck: ObjectStruck, k: int, runs_rad: float | None, *, length_m: float = math.inf
    ) -> FixedObject:
        """An object that touches the vehicle at a step, running as the road does where no direction is given."""
        pose = self.poses[k]
        if runs_rad is None:
            place = roadside_at(self.network, pose.x_m, pose.y_m, z_m=pose.z_m)
            runs_rad = pose.heading_rad if place is None else place.along_rad
        item, at_xy_m = placed(event.vehicle, struck, pose, self._slip_rad(k), runs_rad, straight_m=length_m)
        return clear_of_roadways(item, at_xy_m, self.network)

    def _mapped(self, code: int) -> Iterator[tuple[int, MappedThing]]:
        """Things of a kind that the map has on the vehicle's way beyond the edge, each with the first step that touches
        it."""
        reach_m = 0.0 if KINDS[code].form is ObjectForm.LINE else KINDS[code].width_m / 2
        outside = self.beyond_m.max(axis=1) > 0
        for thing in things_of_kind(self.things, code):
            shape = shapely.Point(thing.xy_m[0]) if len(thing.xy_m) == 1 else shapely.LineString(thing.xy_m)
            touched = outside & (shapely.distance(self.outlines, shape) <= reach_m)
            if touched.any():
                yield int(np.argmax(touched)), thing

    def _touches(self, struck: ObjectStruck) -> list[tuple[float, ObjectStruck]]:
        """For each step how far beyond the edge the part is that strikes (m; -inf where it does not go ahead), and the
        object as struck there: on the reported area, if that ever goes ahead, else on what goes first."""
        if KINDS[struck.code].form is ObjectForm.LINE:
            outermost_m = self.beyond_m.max(axis=1)
            outward = np.diff(outermost_m, prepend=-math.inf) > 0
            return [(float(m) if out else -math.inf, struck) for m, out in zip(outermost_m, outward, strict=True)]
        reported = self._touching([struck] * len(self.poses)) if struck.area is not None else []
        if any(beyond_m >= _NEAREST_M for beyond_m, _ in reported):
            return reported
        return self._touching([replace(struck, area=_ahead(self._slip_rad(k))) for k in range(len(self.poses))])

    def _touching(self, struck: Sequence[ObjectStruck]) -> list[tuple[float, ObjectStruck]]:
        """How far beyond the edge the part is that strikes, for an object at each step, and that object."""
        parts = [self._part(k, each) for k, each in enumerate(struck)]
        places = np.array([part for part in parts if part is not None]).reshape(-1, 2)
        beyond_m = iter(self.area.beyond_m(places[:, 0], places[:, 1]).tolist() if len(places) else ())
        return [(-math.inf if part is None else next(beyond_m), each) for part, each in zip(parts, struck, strict=True)]

    def _part(self, k: int, struck: ObjectStruck) -> FloatArray | None:
        """Where the part is at a step that strikes (x, y; m); None where it does not go ahead."""
        slip_rad = self._slip_rad(k)
        goes = (math.cos(slip_rad), -math.sin(slip_rad))
        spots = spots_of(struck.area, self.body.length_m / 2, self.body.width_m / 2)
        spot = next((each for each in spots if np.dot(goes, each.normal) > _MEETS), None)
        return None if spot is None else self.poses[k].to_world(np.array([spot.ahead_m, spot.left_m]))

    def _slip_rad(self, k: int) -> float:
        """The heading less the course."""
        step = self.steps[k]
        course = math.atan2(self.driven.velocity_y_mps[step], self.driven.velocity_x_mps[step])
        return math.remainder(self.poses[k].heading_rad - course, math.tau)

    def _left_to(self, side: DepartureSide | None, k: int) -> bool:
        """Whether the vehicle left the road to a side by a step; any does where None is reported."""
        return side is None or side in self._sides(k)

    def _sides(self, k: int) -> tuple[DepartureSide, ...]:
        until_s = float(self.driven.time_s[self.steps[k]])
        return left_road_after_contact(self.network, self.log, self.driven.number, until_s)

    def why_not(self, side: DepartureSide | None) -> str:
        """Why there is no place for an object on its way, as a sentence with what was measured."""
        who = f"vehicle {self.driven.number}"
        farthest_m = float(self.beyond_m.max())
        if farthest_m <= 0:
            return f"{who} stays on the carriageway: it comes to {-farthest_m:.1f} m from its edge"
        k = int(np.argmax(self.beyond_m.max(axis=1)))
        if not self._left_to(side, k):
            went = " or ".join(self._sides(k))
            return f"{who} comes {farthest_m:.1f} m beyond the edge: it leaves the road {went}, reported is {side}"
        return f"{who} comes {farthest_m:.1f} m beyond the edge at most, with no part ahead that could strike anything"


def _ahead(slip_rad: float) -> ImpactArea | None:
    """The clock position of what goes first."""
    return impact_area(round(bearing_to_clock_h(-slip_rad)) or 12)
