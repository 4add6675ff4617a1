"""The state of people in MuJoCo's memory: the arrays of a jointed figure, written before a touch and read after it.

Belongs here: placing a figure by its person's plan, and reading place, posture and velocity after a strike. Does not
belong here: the model for MuJoCo (:mod:`trace_dag.simulation.figures`), forces between people, vehicles and the road
(:mod:`trace_dag.simulation.scene`).
"""

from __future__ import annotations

import math
from typing import Any

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.body_sizes import ridden_kg
from trace_dag.simulation.figures import degrees, landmark_names
from trace_dag.simulation.people import REST_MPS, REST_RPS, Person

_CARRIED = 0.2  # the road carries who slides with as much as the weight: so near to it, as limbs settle
_LEAN_RAD = 0.03  # of what is ridden, to the right: exactly upright, nothing would tip it over without its rider


class BodyTree:
    """A person, or a mount, in MuJoCo's memory: a free root and its segments."""

    def __init__(self, mujoco: Any, model: Any, data: Any, name: str, person: Person) -> None:
        self.person = person
        self.velocity = (0.0, 0.0, 0.0)
        """Velocity of its centre of mass, after the last step."""
        self.body_id = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name))
        self.mass_kg = float(model.body_subtreemass[self.body_id])
        self.size_m = person.model.body.height_m
        self.geoms = [k for k in range(model.ngeom) if model.body_rootid[model.geom_bodyid[k]] == self.body_id]
        degrees = [k for k in range(model.nv) if model.body_rootid[model.dof_bodyid[k]] == self.body_id]
        rates = data.qvel[degrees[0] : degrees[-1] + 1]
        pose_at = int(model.jnt_qposadr[int(model.body_jntadr[self.body_id])])
        # Parts of MuJoCo's own memory: place (m) and velocity of the root (m/s), its turning and that of the joints
        # (rad/s), place and velocity of the centre of mass (m, m/s) as measured last, and what is upward in the root's
        # axes.
        self.place = data.qpos[pose_at : pose_at + 3]
        self.moving, self.turning, self.of_joints = rates[:3], rates[3:6], rates[6:]
        self.spinning = rates[3:]
        self.centre, self.measured = data.subtree_com[self.body_id], data.subtree_linvel[self.body_id]
        self.upward = data.xmat[self.body_id][6:]

    def lies_still(self, carried_n: float) -> bool:
        """Return whether the body only slides or rests on the road, which carries it with a force (N)."""
        ground = self.person.ground
        vx, vy, vz = self.velocity
        rises_mps = vz - vx * ground.slope_x - vy * ground.slope_y
        weight_n = self.mass_kg * GRAVITY_MPS2
        carried = abs(carried_n - weight_n) < _CARRIED * weight_n
        return carried and abs(rises_mps) < REST_MPS and max(map(abs, self.spinning.tolist())) < REST_RPS

    def slide(self, friction: float, step_s: float) -> None:
        """Move one step along the road as one body: friction stops it, and its weight pulls it down a grade."""
        ground = self.person.ground
        x, y, z = self.place.tolist()
        vx, vy, _ = self.velocity
        # Seen from above the road's force and friction are both less by the squared cosine of the grade.
        pressed_mps = GRAVITY_MPS2 / (1.0 + ground.slope_x**2 + ground.slope_y**2) * step_s
        end_vx, end_vy = vx - pressed_mps * ground.slope_x, vy - pressed_mps * ground.slope_y
        speed, lost = math.hypot(end_vx, end_vy), friction * pressed_mps
        share = max(0.0, 1.0 - lost / speed) if speed > 0 else 0.0
        end_vx, end_vy = end_vx * share, end_vy * share
        dx, dy = (vx + end_vx) / 2 * step_s, (vy + end_vy) / 2 * step_s
        rises = end_vx * ground.slope_x + end_vy * ground.slope_y
        self.place[:] = x + dx, y + dy, z + dx * ground.slope_x + dy * ground.slope_y
        self.velocity = end_vx, end_vy, rises
        self.moving[:] = self.velocity
        self.spinning[:] = 0.0


class FigureState:
    """A person's figure in MuJoCo's arrays."""

    def __init__(self, mujoco: Any, model: Any, data: Any, index: int, person: Person) -> None:
        body_id = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"p{index}"))
        self._body_id = body_id
        self._data = data
        joint = int(model.body_jntadr[body_id])
        start, rate = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        of_pose, of_rates = degrees(person.model.body)
        self._pose, self._rates = data.qpos[start : start + of_pose], data.qvel[rate : rate + of_rates]
        self._rides = ridden_kg(person.model.body) > 0
        names = landmark_names(person.model.body)
        first = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"p{index}_at_{names[0]}"))
        self._points = data.site_xpos[first : first + len(names)]
        end, last = start + of_pose, rate + of_rates
        self._ridden = (data.qpos[end : end + 7], data.qvel[last : last + 6]) if self._rides else None
        self._angles: tuple[float, float, float] | None = None
        # Where the centre of mass is ahead of the pelvis while nobody has touched it: it is what the plan moves.
        posture = person.walking_posture(0.0)
        self._upright = posture.pelvis
        self._ahead_m = 0.0
        self.carry(person, 0.0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        off_x, off_y = data.subtree_com[body_id][0] - person.x, data.subtree_com[body_id][1] - person.y
        self._ahead_m = off_x * math.cos(person.heading) + off_y * math.sin(person.heading)

    def carry(self, person: Person, time_s: float) -> None:
        posture = person.walking_posture(time_s)
        c, s = math.cos(person.heading), math.sin(person.heading)
        x, y = person.x - self._ahead_m * c, person.y - self._ahead_m * s
        height = person.standing_height(posture)
        half = person.heading / 2
        turned = _times((math.cos(half), 0.0, 0.0, math.sin(half)), posture.pelvis)
        self._pose[:] = (x, y, self._road_z(person, x, y) + height, *turned, *posture.pose())
        self._rates[:] = 0.0
        self._rates[:2] = (person.vx, person.vy)
        if self._ridden is not None:
            pose, rates = self._ridden
            c, s, up = math.cos(half), math.sin(half), math.cos(_LEAN_RAD / 2)
            lean = math.sin(_LEAN_RAD / 2)
            pose[:3] = (person.x, person.y, self._road_z(person, person.x, person.y))
            pose[3:] = (c * up, c * lean, s * lean, s * up)
            rates[:] = 0.0
            rates[:2] = (person.vx, person.vy)

    @staticmethod
    def _road_z(person: Person, x: float, y: float) -> float:
        return person.z + person.ground.slope_x * (x - person.x) + person.ground.slope_y * (y - person.y)

    def follow(self, person: Person) -> None:
        person.x, person.y = self._pose[:2].tolist()
        person.vx, person.vy = self._rates[:2].tolist()

    def _fastest(self) -> tuple[float, float]:
        """Return the speed of the pelvis or the mount (m/s), and that of the fastest joint (rad/s)."""
        x, y, z, *turning = self._rates.tolist()
        speed = math.hypot(x, y, z)
        if self._ridden is not None:
            speed = max(speed, math.hypot(*self._ridden[1][:3].tolist()))
        return speed, max(map(abs, turning))

    def look(self, person: Person, time_s: float) -> None:
        data = self._data
        centre, pitch, roll = data.subtree_com[self._body_id], 0.0, 0.0
        if person.crashed:
            yaw, pitch, roll = self._turned(data.xmat[self._body_id].tolist(), person)
            x, y = float(centre[0]), float(centre[1])
            person.z = self._road_z(person, x, y)
            person.x, person.y = x, y
            person.vx, person.vy = data.subtree_linvel[self._body_id][:2].tolist()
            person.heading = yaw
            person.look_for_rest(*self._fastest(), time_s)
            person.yaw_rate = float(data.cvel[self._body_id][2])
        landmarks = (self._points - (person.x, person.y, person.z)).round(3).ravel().tolist()
        person.posture = (float(centre[2]) - person.z, pitch, roll, *landmarks)

    def _turned(self, matrix: list[float], person: Person) -> tuple[float, float, float]:
        """Return the heading, pitch and roll of the pelvis relative to its upright posture.

        The rotation nearer to the last one is taken, so that a body on its back does not appear to flip.
        """
        c, s = math.cos(self._upright), math.sin(self._upright)
        # Columns of the matrix turned back about the left axis.
        m00, m10, m20 = (matrix[3 * k] * c + matrix[3 * k + 2] * s for k in range(3))
        m22 = matrix[8] * c - matrix[6] * s
        m21 = matrix[7]
        yaw, pitch, roll = math.atan2(m10, m00), math.asin(max(-1.0, min(1.0, -m20))), math.atan2(m21, m22)
        last = self._angles or (person.heading, 0.0, 0.0)
        ways = [(yaw, pitch, roll), (yaw + math.pi, math.pi - pitch, roll + math.pi)]
        near = [
            tuple(was + math.remainder(now - was, math.tau) for was, now in zip(last, way, strict=True)) for way in ways
        ]
        best = min(near, key=lambda way: math.fsum(abs(now - was) for was, now in zip(last, way, strict=True)))
        self._angles = (best[0], best[1], best[2])
        return self._angles


def _times(quaternion: tuple[float, float, float, float], about_left: float) -> tuple[float, ...]:
    """Return a rotation about the vertical, followed by one about the body's own left axis."""
    w, _, _, z = quaternion
    c, s = math.cos(about_left / 2), math.sin(about_left / 2)
    return w * c, -z * s, w * s, z * c
