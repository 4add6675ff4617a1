"""Vehicles and people in MuJoCo: the vehicles of :mod:`trace_dag.simulation.rigid`, and jointed figures in space.

Vehicles stay upright bodies in the plane, with the boxes of :mod:`trace_dag.simulation.fronts` for contacts with
people; figures fall under gravity on the road's tangent plane. Before every step, an untouched person is placed by the
plan, so that only a vehicle's touch releases the figure.

Contact with vehicles is MuJoCo's own, springs and dampers with friction in an elliptic cone, at every segment; the
friction's reference is slower than the normal one, so that MuJoCo's convex relaxation does not push sliding bodies
apart. The road carries every segment without friction. Its friction acts on the person as a whole, because it was
measured on whole people and dummies that slide, roll and tumble. The force is mu times the road's normal force against
the velocity of the centre of mass: Searle's law (SAE 831622) for landing, bouncing and sliding alike. The same friction
slows down rotation about the vertical and the limbs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from trace_dag.common.errors import Failure
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.figure_state import BodyTree, FigureState
from trace_dag.simulation.figures import figure_mjcf
from trace_dag.simulation.fronts import ShellBox, shell, shows_wheels
from trace_dag.simulation.people import Person, PersonTouch
from trace_dag.simulation.rigid import RigidBodies, vehicle_bodies
from trace_dag.simulation.surface import Ground
from trace_dag.simulation.vehicles import VehicleModel

_VEHICLE_RATE_RPS, _VEHICLE_DAMPING_RATIO = 40.0, 2.6
"""Stiffness of the contact of a person and a vehicle: struck at 10 m/s a segment presses some four centimetres in, at
30 m/s thirteen, as legs, clothes and sheet metal give, and comes back so slowly that nothing rebounds. Throws are right
over a range of these: 95 to 97 % of a car's and a van's at rates of 35 to 40, ratios of 2.6 to 3.4."""
VEHICLE_FRICTION = 0.9
"""Friction of people on a vehicle while they are struck: the sheet metal gives way under a body and holds it in its
dent."""
_CARRIED_FRICTION = 0.3
"""Friction of people who lie on a vehicle afterwards: clothes on sheet metal slide at 0.2 to 0.4 (Simms and Wood,
Pedestrian and Cyclist Impact, 2009), so that people slide off the hood when the driver brakes."""
_SLIPS = 1e-3
_IMPLICIT_FROM_S = 0.004
"""Steps from which on velocities are integrated implicitly: limbs that spin in flight gain energy by explicit ones."""
_MOST_WHEEL_LOAD_N = 44_500.0
"""Load of the wheels on one side of an axle: half of 20,000 lb, the heaviest single axle on US interstates (23 CFR
658.17); of a lighter vehicle a quarter of its weight."""
_LIES_BELOW_M = 0.3  # centre of mass above the road
_LYING_M = 0.24  # height of a trunk that lies
_CLIMBS_M = 0.5
"""Distance of a vehicle from touching a person before its wheel until the wheel is on top: 2 sqrt(R r), of a tyre
of R = 0.5 m and a trunk of r = 0.12 m. The tyre does not push the trunk on: it draws it under where its friction is
above tan(nip angle / 2) = sqrt(r / R) = 0.49, as a rolling mill draws in what it rolls; rubber on clothes has more."""
_CREEPS_MPS = 1.0
_SEEN_M = 0.2  # so near to a vehicle a segment is seen, before it touches
_VEHICLE_SLIDING = 0.3  # rate of the friction's reference, of the normal one
_ROAD_RATE_RPS, _ROAD_DAMPING_RATIO = 100.0, 1.0
_TURNING = 3.0
"""Ratio, in rad/s times stature, by which the road's friction stops turning faster than sliding: moment mu N h/4 over
the inertia m h^2/12 of a body that lies flat."""
_LIMBS_MPS = 1.0  # an impulse of the road of so much per mass stops the limbs to 1/e


class FigureBodies(RigidBodies):
    """Vehicles and people. The bodies' numbers are the vehicles', then the people's."""

    def __init__(
        self,
        models: list[VehicleModel],
        people: list[Person],
        *,
        person_friction: float,
    ) -> None:
        self._people = people
        self._person_friction = person_friction
        self._segments: list[tuple[list[str], list[str]]] = []
        super().__init__(models)
        mujoco, model = self._mujoco, self._model
        self._fast, self._implicit = mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_IMPLICIT
        self._last_step_s = 0.0
        self._bad = int(mujoco.mjtWarning.mjWARN_BADQACC)
        self.touches: dict[tuple[int, int], list[PersonTouch]] = {}
        """Places where people touched vehicles in the state the last step began with, by the numbers of the two
        bodies."""
        self.lying_still = False
        """True while all who were touched slide on the road or rest there, with limbs that no longer move and touched
        by no vehicle: until the next step of MuJoCo's they can slide as they lie."""

        def geom(name: str) -> int:
            return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name))

        self._owner: dict[int, int] = {}
        for i, vehicle in enumerate(models):
            self._owner |= {geom(f"v{i}_{k}"): i for k in range(len(shell(vehicle.body)))}
        for j, (segments, parts) in enumerate(self._segments):
            self._owner |= {geom(name): len(models) + j for name in (*segments, *parts)}
        self._trees = [
            BodyTree(mujoco, model, self._data, name, person)
            for j, person in enumerate(people)
            for name in ((f"p{j}", f"p{j}_ridden") if self._segments[j][1] else (f"p{j}",))
        ]
        self._tree_of = {shape: tree for tree in self._trees for shape in tree.geoms}
        self._pushed: dict[BodyTree, tuple[float, float, float]] = {}  # by whatever it touched in the last step, N
        self._carried: dict[BodyTree, float] = {}  # by the road in the last step: normal force, N
        self._pressed: dict[tuple[tuple[int, int], BodyTree], list[PersonTouch]] = {}  # down, by a vehicle
        self._climbed: dict[tuple[int, BodyTree], tuple[float, float]] = {}
        """Impulse (N s) and distance (m) by which a vehicle has pushed a person who lies before it."""
        self._wheel_loads_n = [min(m.body.mass_kg * GRAVITY_MPS2 / 4, _MOST_WHEEL_LOAD_N) for m in models]
        self._wheels_touch = [shows_wheels(m.body) for m in models]
        self._shells = []
        for i, vehicle in enumerate(models):
            geoms = np.array([geom(f"v{i}_{k}") for k in range(len(shell(vehicle.body)))])
            self._shells.append((geoms, model.geom_pos[geoms].copy()))
        self._grades = [0.0] * len(models)  # of the road under each vehicle, the way it heads, as the boxes have it
        self._grounds: list[Ground | None] = [None] * len(people)  # under each person, as the planes have it
        self._planes = [geom(f"road{j}") for j in range(len(people))]
        model.geom_sameframe[self._planes] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # else they stay where they are made
        self._figures = [FigureState(mujoco, model, self._data, j, person) for j, person in enumerate(people)]

    # --- the road ----------------------------------------------------------------------------------------------
    def stand_on_road(self, vehicles: Sequence[Vehicle]) -> None:
        """Put the road and the ends of the vehicles' boxes under each person at the height of the tangent plane.

        On a grade a level front would hang in the air or be in the ground.
        """
        for i, (vehicle, (geoms, level_m)) in enumerate(zip(vehicles, self._shells, strict=True)):
            ground = vehicle.ground
            grade = ground.slope_x * math.cos(vehicle.heading) + ground.slope_y * math.sin(vehicle.heading)
            if grade != self._grades[i]:
                self._grades[i] = grade
                self._model.geom_pos[geoms] = level_m + np.outer(level_m[:, 0], (0.0, 0.0, grade))
        for j, (plane, person) in enumerate(zip(self._planes, self._people, strict=True)):
            if person.ground == self._grounds[j]:
                continue
            self._grounds[j] = person.ground
            self.lying_still = False  # MuJoCo moves people from one grade onto another
            slope_x, slope_y = person.ground.slope_x, person.ground.slope_y
            tilt = math.hypot(slope_x, slope_y)
            half = math.atan(tilt) / 2
            about = math.sin(half) / tilt if tilt else 0.0  # the level line: uphill is turned up
            self._model.geom_pos[plane] = (person.x, person.y, person.z)
            self._model.geom_quat[plane] = (math.cos(half), about * slope_y, -about * slope_x, 0.0)

    # --- people ------------------------------------------------------------------------------------------------
    def carry(self, time_s: float) -> None:
        """Move every untouched person to the planned place at a time."""
        for figure, person in zip(self._figures, self._people, strict=True):
            if not person.crashed:
                person.walk(time_s)
                figure.carry(person, time_s)
        for tree in self._trees:
            if not tree.person.crashed:
                tree.velocity = (tree.person.vx, tree.person.vy, 0.0)

    def let_slide(self, pair: tuple[int, int]) -> None:
        """End the strike of a pair: further contact slides as clothes on sheet metal."""
        trees = [tree for tree in self._trees if tree.person is self._people[pair[1] - self._count]]
        for tree in trees:
            self._model.pair_friction[self._meetings(pair[0], tree), :2] = _CARRIED_FRICTION

    def let_go(self, pair: tuple[int, int], off_mps: tuple[float, float]) -> None:
        """Let a person carried by a vehicle slide off it without friction, at a velocity to its side."""
        for tree in self._trees:
            if tree.person is self._people[pair[1] - self._count]:
                self._model.pair_friction[self._meetings(pair[0], tree), :2] = _SLIPS
                vx, vy, vz = tree.velocity
                tree.velocity = vx + off_mps[0], vy + off_mps[1], vz
                tree.moving[:2] += off_mps

    def follow(self) -> None:
        """Update the state of touched people roughly, to that of the pelvis."""
        for figure, person in zip(self._figures, self._people, strict=True):
            if person.crashed:
                figure.follow(person)

    def slide(self, step_s: float) -> None:
        """Move all touched people a step along the road."""
        for tree in self._trees:
            if tree.person.crashed:
                tree.slide(self._person_friction, step_s)

    def look(self, time_s: float) -> None:
        """Update the state and posture of all people exactly."""
        if self._data.warning[self._bad].number:
            raise Failure("the figures of people came apart in MuJoCo's solver; this is a fault of ours")
        figures = zip(self._figures, self._people, strict=True)
        moving = [each for each in figures if not (self.lying_still and each[1].crashed and each[1].at_rest)]
        if not moving:
            return
        self._measure_places()
        self._measure_velocities()
        for figure, person in moving:
            figure.look(person, time_s)
        touched = [tree for tree in self._trees if tree.person.crashed]
        self.lying_still = self.lying_still or (
            not self.touches and all(tree.lies_still(self._carried.get(tree, 0.0)) for tree in touched)
        )

    # --- contact -----------------------------------------------------------------------------------------------
    def step(self, forces: list[float], step_s: float) -> dict[tuple[int, int], tuple[float, float]]:
        """Advance a step as with vehicles alone, with people and the forces on them."""
        self.touches, self.lying_still = {}, False
        if step_s != self._last_step_s:
            self._last_step_s = step_s
            self._model.opt.integrator = self._fast if step_s < _IMPLICIT_FROM_S else self._implicit
        self._carried.clear()
        self._pushed.clear()
        self._pressed.clear()
        super().step(forces, step_s)
        if self._data.nefc:
            self._note_touches()
        if self._pressed:
            self._let_up(step_s)
            self._roll_over(step_s)
        self._settle_velocities(step_s)
        return {
            pair: (math.fsum(t.force[0] for t in touches), math.fsum(t.force[1] for t in touches))
            for pair, touches in self.touches.items()
        }

    def is_near(self, pair: tuple[int, int]) -> bool:
        """Return whether a vehicle and a person were near each other in the state before the last step."""
        if pair in self.touches:
            return True
        meets = (self._owner.get(one) == pair[0] and self._owner.get(two) == pair[1] for one, two in self._contacts())
        return any(meets)

    def _contacts(self) -> Iterator[tuple[int, int]]:
        """Yield the shapes of vehicles and people that were near each other, the vehicle's first."""
        for one, two in self._data.contact.geom.tolist():
            yield (one, two) if self._owner.get(one, self._count) < self._count else (two, one)

    def _note_touches(self) -> None:
        """Record the forces of vehicles and the road on people in this step."""
        contacts: Any = self._data.contact
        owner, vehicles = self._owner, self._count
        # Most contacts are shapes that are near each other and do not touch: only of the others more is read.
        pressing = [(k, row) for k, row in enumerate(contacts.efc_address.tolist()) if row >= 0]
        if not pressing:
            return
        forces = self._data.efc_force.tolist()
        shapes, distances, frames, points = contacts.geom, contacts.dist, contacts.frame, contacts.pos
        for k, row in pressing:
            first, second = shapes[k].tolist()
            one, two = owner.get(first), owner.get(second)
            nx, ny, nz, ax, ay, az, bx, by, bz = frames[k].tolist()
            if one is None or two is None:  # the road
                tree = self._tree_of.get(second)  # MuJoCo names a plane first
                if tree is not None:
                    carried_n = forces[row]
                    self._carried[tree] = self._carried.get(tree, 0.0) + carried_n
                    self._push(tree, (carried_n * nx, carried_n * ny, carried_n * nz))
                continue
            distance = float(distances[k])
            if distance >= 0:
                continue
            sense = 1.0 if one < vehicles else -1.0  # the frame's normal points to the second
            pair = (one, two) if one < vehicles else (two, one)
            along, across_1, across_2 = forces[row : row + 3]
            force = (
                sense * (along * nx + across_1 * ax + across_2 * bx),
                sense * (along * ny + across_1 * ay + across_2 * by),
                sense * (along * nz + across_1 * az + across_2 * bz),
            )
            tree = self._tree_of[second if one < vehicles else first]
            self._push(tree, force)
            normal = (sense * nx, sense * ny, sense * nz)
            touch = PersonTouch(-distance, points[k].tolist(), normal, force)
            self.touches.setdefault(pair, []).append(touch)
            self._pressed.setdefault((pair, tree), []).append(touch)

    def _push(self, tree: BodyTree, force: tuple[float, ...]) -> None:
        before = self._pushed.get(tree, (0.0, 0.0, 0.0))
        self._pushed[tree] = (before[0] + force[0], before[1] + force[1], before[2] + force[2])

    def _let_up(self, over_s: float) -> None:
        """Limit the force of a vehicle on a person on the ground to one wheel's load.

        A real vehicle rises on its springs and goes over the person. In the plane it cannot rise, and MuJoCo's solver,
        to part vehicle, body and road, would throw the body up and stop the vehicle.
        """
        for (pair, tree), touches in self._pressed.items():
            vehicle, down_n = pair[0], -math.fsum(min(touch.force[2], 0.0) for touch in touches)
            too_much_n = min(down_n, self._carried.get(tree, 0.0)) - self._wheel_loads_n[vehicle]
            if too_much_n <= 0:
                continue
            share = too_much_n / down_n
            carried_n = self._wheel_loads_n[vehicle] + tree.mass_kg * GRAVITY_MPS2
            self._push(tree, (0.0, 0.0, carried_n - self._carried[tree]))
            self._carried[tree] = carried_n
            k = 3 * vehicle
            per_mass, per_inertia = self._inverse[vehicle]
            for touch in touches:
                back_x, back_y, back_z = (-share * value for value in touch.force)
                self._push(tree, (back_x, back_y, back_z))
                arm_x, arm_y = touch.point[0] - self._positions[k], touch.point[1] - self._positions[k + 1]
                self._rates[k] -= back_x * per_mass * over_s
                self._rates[k + 1] -= back_y * per_mass * over_s
                self._rates[k + 2] -= (arm_x * back_y - arm_y * back_x) * per_inertia * over_s
                kept = self.touches[pair]
                kept[kept.index(touch)] = touch._replace(force=tuple((1.0 - share) * value for value in touch.force))

    def _roll_over(self, over_s: float) -> None:
        """Let vehicles pass over a person on the ground once they have climbed.

        They push with a wheel's load until they have risen by the height of a lying body. If a wheel touches, they push
        until it has gone as far as the tyre needs to draw the body under.
        """
        for ((vehicle, _), tree), touches in self._pressed.items():
            if not self._lies(tree):
                continue
            speed = max(math.hypot(*self._rates[3 * vehicle : 3 * vehicle + 2].tolist()), _CREEPS_MPS)
            load_n, by_wheel = self._wheel_loads_n[vehicle], self._wheels_touch[vehicle]
            pushed_ns, gone_m = self._climbed.get((vehicle, tree), (0.0, 0.0))
            pushed_ns += (
                math.hypot(math.fsum(t.force[0] for t in touches), math.fsum(t.force[1] for t in touches)) * over_s
            )
            gone_m += speed * over_s
            self._climbed[vehicle, tree] = pushed_ns, gone_m
            if pushed_ns > load_n * _LYING_M / speed or (by_wheel and gone_m > _CLIMBS_M):
                self._model.pair_margin[self._meetings(vehicle, tree)] = -math.inf  # they no longer meet
                del self._climbed[vehicle, tree]

    def _meetings(self, vehicle: int, tree: BodyTree) -> Any:
        """Return a mask of the model's pairs of shapes of a vehicle and a person."""
        shapes, one, two = self._shells[vehicle][0], self._model.pair_geom1, self._model.pair_geom2
        return (np.isin(one, shapes) & np.isin(two, tree.geoms)) | (np.isin(two, shapes) & np.isin(one, tree.geoms))

    def _lies(self, tree: BodyTree) -> bool:
        return float(tree.centre[2]) - tree.person.z < _LIES_BELOW_M

    def _settle_velocities(self, step_s: float) -> None:
        """Set every centre of mass to the velocity of its forces, and add the road's friction as an impulse.

        With fast limbs, the integration would deviate from it (by 2 % of a strike at 30 m/s).
        """
        free = [tree for tree in self._trees if tree.person.crashed or tree in self._pushed]
        if not free:
            return
        wanted = []
        self._measure_places()
        for tree in free:
            push_x, push_y, push_z = self._pushed.get(tree, (0.0, 0.0, 0.0))
            per_mass = step_s / tree.mass_kg
            x, y, z = tree.velocity
            x, y, z = x + push_x * per_mass, y + push_y * per_mass, z + push_z * per_mass - GRAVITY_MPS2 * step_s
            lost = self._person_friction * self._carried.get(tree, 0.0) * per_mass
            if lost:
                sliding = math.hypot(x, y)
                share = max(0.0, 1.0 - lost / sliding) if sliding > 0 else 0.0
                x, y = x * share, y * share
                turning = float(tree.upward @ tree.turning)
                most = _TURNING * lost / tree.size_m
                tree.turning -= min(most, max(-most, turning)) * tree.upward
                tree.of_joints *= math.exp(-lost / self._person_friction / _LIMBS_MPS)
            wanted.append((x, y, z))
        self._measure_velocities()
        for tree, (x, y, z) in zip(free, wanted, strict=True):
            was_x, was_y, was_z = tree.measured.tolist()
            at_x, at_y, at_z = tree.moving.tolist()
            tree.moving[:] = at_x + (x - was_x), at_y + (y - was_y), at_z + (z - was_z)
            tree.velocity = (x, y, z)

    def _measure_places(self) -> None:
        """Update places and centres of mass to the present state."""
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_comPos(self._model, self._data)

    def _measure_velocities(self) -> None:
        """Update the velocities of centres of mass to the present state, after the places."""
        self._mujoco.mj_comVel(self._model, self._data)
        self._mujoco.mj_subtreeVel(self._model, self._data)

    # --- the model ---------------------------------------------------------------------------------------------
    def _in_mujoco(self, models: list[VehicleModel]) -> tuple[Any, Any]:
        model = self._mujoco.MjModel.from_xml_string(self._mjcf(models))
        return model, self._mujoco.MjData(model)

    def release(self) -> None:
        """Release nothing, because no other run has the same people."""

    def _mjcf(self, models: list[VehicleModel]) -> str:
        vehicles = vehicle_bodies(models, _shell_mjcf)
        roads, figures, pairs = "", "", ""
        for j, person in enumerate(self._people):
            roads += f'<geom name="road{j}" type="plane" size="0 0 1" contype="0" conaffinity="0"/>'
            xml, segments, parts = figure_mjcf(f"p{j}", person.model.body)
            figures += xml
            self._segments.append((segments, parts))
            meets_vehicles = [*segments, *(part for part in parts if not part.endswith(("_front", "_rear")))]
            pairs += "".join(
                f'<pair geom1="road{j}" geom2="{part}" condim="1" {_solref(_ROAD_RATE_RPS, _ROAD_DAMPING_RATIO)}/>'
                for part in (*segments, *parts)
            )
            pairs += "".join(
                _meeting(f"v{i}_{k}", part)
                for i, m in enumerate(models)
                for k in range(len(shell(m.body)))
                for part in meets_vehicles
            )
        return (
            '<mujoco><compiler inertiafromgeom="auto" angle="radian"/>'
            f'<option gravity="0 0 {-GRAVITY_MPS2!r}" integrator="implicit" cone="elliptic"/>'
            f"<worldbody>{roads}{vehicles}{figures}</worldbody><contact>{pairs}</contact></mujoco>"
        )


def _shell_mjcf(number: int, model: VehicleModel) -> str:
    return "".join(_box_mjcf(f"v{number}_{k}", box, model.cg_ahead_m) for k, box in enumerate(shell(model.body)))


def _box_mjcf(name: str, box: ShellBox, cg_ahead_m: float) -> str:
    x, y, z = box.centre_m
    half = " ".join(repr(value) for value in box.half_m)
    return (
        f'<geom name="{name}" type="box" pos="{x - cg_ahead_m!r} {y!r} {z!r}" size="{half}" '
        f'euler="0 {box.pitch_rad!r} 0" contype="0" conaffinity="0"/>'
    )


def _meeting(one: str, two: str) -> str:
    friction, sliding = VEHICLE_FRICTION, _VEHICLE_SLIDING * 2 * _VEHICLE_DAMPING_RATIO * _VEHICLE_RATE_RPS
    return (
        f'<pair geom1="{one}" geom2="{two}" condim="3" friction="{friction!r} {friction!r} 0 0 0" '
        f'{_solref(_VEHICLE_RATE_RPS, _VEHICLE_DAMPING_RATIO)} solreffriction="0 {-sliding!r}" '
        f'gap="{_SEEN_M!r}"/>'
    )


def _solref(rate_rps: float, damping_ratio: float) -> str:
    """Return a spring and damper by natural frequency and damping ratio, for any masses."""
    return f'solref="{-(rate_rps**2)!r} {-2 * damping_ratio * rate_rps!r}"'
