"""A person in MuJoCo: nine jointed segments, upright, walking or riding. A cycle or mount is a body of its own.

Segments: pelvis, thorax with abdomen, head with neck, arms, thighs, shanks with feet. Their shares of the mass are
Dempster's and their lengths Drillis and Contini's (both as in Winter, Biomechanics and Motor Control of Human Movement,
4th ed., 2009), all relative to the stature; their girth grows with the root of mass by stature. Joints have the ranges
of relaxed people, roughly, and the little resistance of passive tissue: muscles have no effect after a strike. Knees
give way to all sides, as they do once ligaments or bones of a struck leg have failed (from some 15 km/h on: Kajzer et
al., SAE 973326). That is the usual multi-body pedestrian (van Wijk et al., SAE 830186; Ishikawa et al., SAE 933129).

Axes of the figure: ahead, left, up. The root is the pelvis at the height of the hip joints. Animals have figures of
their own (:mod:`trace_dag.simulation.quadrupeds`), which this module returns, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from trace_dag.simulation import quadrupeds
from trace_dag.simulation.body_sizes import BICYCLE_LENGTH_M, ridden_kg
from trace_dag.simulation.figure_parts import FigureParts
from trace_dag.simulation.quadrupeds import Stance
from trace_dag.simulation.types import Body, BodyKind

_HIP, _KNEE, _LUMBAR, _SHOULDER, _NECK = 0.530, 0.285, 0.620, 0.800, 0.825  # heights, of the stature
_ARM_LENGTH = 0.36
_ADULT_KG_PER_M = 45.0
_ADULT_KGM2 = 240.0  # mass times stature squared, by which the joints' resistance is scaled
_STEP_LENGTH = 0.42  # of the stature, at 1.4 m/s; it grows with the root of the speed
_STROLL_MPS = 1.4
_STANDS_MPS = 0.2
_LONGEST_SWING_RAD = 0.6
_ARM_SWING = 0.7  # of the leg's

SEGMENTS = ("pelvis", "thorax", "head", "arm_l", "arm_r", "thigh_l", "thigh_r", "shank_l", "shank_r")
LANDMARKS = ("pelvis", "neck", "head", "hand_l", "hand_r", "knee_l", "foot_l", "knee_r", "foot_r")
"""Points of a person that a log keeps, in this order."""
RIDDEN_LANDMARKS = ("front", "rear", "top")
"""And of what the person rides: hub of the front wheel, of the rear wheel, middle of the handlebar."""
PLACE_OF_LANDMARK = {name: k for k, name in enumerate((*LANDMARKS, *RIDDEN_LANDMARKS))}
_DEGREES = (7 + 4 * 8, 6 + 3 * 8)


@dataclass(frozen=True)
class Posture:
    """The posture of a figure: angles about the left axis (rad), each relative to the segment above.

    Angles are positive forward and down for parts above the hips, backward for parts that hang below a joint.
    """

    pelvis: float = 0.0
    lumbar: float = 0.0
    neck: float = 0.0
    shoulders: tuple[float, float] = (0.0, 0.0)  # left, right
    hips: tuple[float, float] = (0.0, 0.0)
    knees: tuple[float, float] = (0.0, 0.0)

    def pose(self) -> list[float]:
        """Return the joint positions for MuJoCo, without the root's: lumbar, neck, shoulders, hips and knees."""
        (left_hip, right_hip), (left_knee, right_knee) = self.hips, self.knees
        return [
            *_turn(self.lumbar),
            *_turn(self.neck),
            *_turn(self.shoulders[0]),
            *_turn(self.shoulders[1]),
            *_turn(left_hip),
            *_turn(left_knee),
            *_turn(right_hip),
            *_turn(right_knee),
        ]

    def hip_height(self, stature_m: float) -> float:
        """Return the height of the hips above the lower of the two soles (m)."""
        thigh, shank = (_HIP - _KNEE) * stature_m, _KNEE * stature_m
        sole_m = _radius_shank(stature_m, 1.0)
        return max(
            thigh * math.cos(self.pelvis + hip) + (shank - sole_m) * math.cos(self.pelvis + hip + knee) + sole_m
            for hip, knee in zip(self.hips, self.knees, strict=True)
        )


RIDING = Posture(0.30, 0.25, -0.40, (-1.55, -1.55), (-0.90, -1.60), (0.60, 1.70))
_PEDAL_M = 0.12  # the lower pedal above the road
DECK_M = 0.10  # top of a conveyance's deck above the road


def walking(stature_m: float, speed_mps: float, travelled_m: float) -> Posture:
    """Return the posture of a person who walks or runs, after a distance; arms swing against legs.

    >>> walking(1.75, 0.0, 3.0) == Posture()  # stands
    True
    >>> ahead, behind = walking(1.75, 1.4, 0.0).hips
    >>> ahead > 0, ahead + behind
    (True, 0.0)
    """
    if speed_mps < _STANDS_MPS:
        return Posture()
    step_m = _STEP_LENGTH * stature_m * math.sqrt(speed_mps / _STROLL_MPS)
    swing = min(_LONGEST_SWING_RAD, math.asin(min(0.9, step_m / 2 / (_HIP * stature_m))))
    angle = swing * math.cos(math.pi * travelled_m / step_m)
    arm = _ARM_SWING * angle
    return Posture(shoulders=(-arm, arm), hips=(angle, -angle))


def degrees(body: Body) -> tuple[int, int]:
    """Return the lengths of a figure's pose and rates: a free root and eight ball joints, for an animal nine.

    >>> from trace_dag.crash.record import VehicleClass
    >>> degrees(Body(BodyKind.PEDESTRIAN, VehicleClass.OTHER, 0.3, 0.5, 1.75, 80.0))  # 7 + 8 x 4, 6 + 8 x 3
    (39, 30)
    """
    return quadrupeds.DEGREES if body.kind is BodyKind.ANIMAL else _DEGREES


def landmark_names(body: Body) -> tuple[str, ...]:
    """Return the points of a body that a log keeps, in order."""
    if body.kind is BodyKind.ANIMAL:
        return quadrupeds.LANDMARKS
    rides = body.kind is not BodyKind.PEDESTRIAN and ridden_kg(body) > 0
    return (*LANDMARKS, *(RIDDEN_LANDMARKS if rides else ()))


def root_height(body: Body, posture: Posture | Stance) -> float:
    """Return the height of the root above the road (m) of a figure in a posture on its mount."""
    if isinstance(posture, Stance):
        return posture.root_height_m(quadrupeds.build(body))
    above = posture.hip_height(body.height_m)
    if body.kind is BodyKind.CYCLIST:
        return above + _PEDAL_M
    if body.kind is BodyKind.CONVEYANCE:
        return above + DECK_M
    return above


def figure_mjcf(name: str, body: Body) -> tuple[str, list[str], list[str]]:
    """Return a figure as MJCF, with the names of its segments and of its mount.

    A pedestrian or an animal has no mount.

    >>> from trace_dag.simulation.body_sizes import person_body
    >>> _, segments, ridden = figure_mjcf("p", person_body(BodyKind.PEDESTRIAN, 40))
    >>> len(segments) == len(SEGMENTS), ridden
    (True, [])
    """
    if body.kind is BodyKind.ANIMAL:
        return *quadrupeds.figure_mjcf(name, body), []
    rides = ridden_kg(body)
    person = _person_mjcf(name, body.height_m, body.mass_kg - rides)
    segments = [f"{name}_{segment}" for segment in SEGMENTS]
    if body.kind is BodyKind.CYCLIST:
        ridden, parts = _bicycle_mjcf(name, body.length_m / BICYCLE_LENGTH_M, rides)
    elif body.kind is BodyKind.CONVEYANCE:
        ridden, parts = _conveyance_mjcf(name, body.length_m, rides)
    else:
        ridden, parts = "", []
    return person + ridden, segments, parts


def _turn(angle: float) -> tuple[float, float, float, float]:
    return math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0


def _radius_shank(stature_m: float, girth: float) -> float:
    return 0.030 * stature_m * girth


def _person_mjcf(name: str, stature_m: float, mass_kg: float) -> str:
    h, m = stature_m, mass_kg
    girth = min(1.35, max(0.75, math.sqrt(m / h / _ADULT_KG_PER_M)))
    stiff = m * h * h / _ADULT_KGM2
    head_m = 0.040 * h + 0.042  # children's heads are bigger for their stature
    thigh_m, trunk_m = 0.045 * h * girth, 0.085 * h * girth

    parts = FigureParts(name, m, stiff)
    joint, capsule, site = parts.joint, parts.capsule, parts.site

    def arm(side: str, sign: float) -> str:
        end = f"0 0 {-_ARM_LENGTH * h!r}"
        return (
            f'<body pos="0 {sign * 0.120 * h!r} {(_SHOULDER - _LUMBAR) * h!r}">{joint(6.0, 2.6)}'
            + capsule(f"arm_{side}", 0.050, 0.026 * h * girth, "0 0 0", end)
            + site(f"hand_{side}", end)
            + "</body>"
        )

    def leg(side: str, sign: float) -> str:
        knee_at, shank_r = f"0 0 {-(_HIP - _KNEE) * h!r}", _radius_shank(h, 1.0)
        sole = f"0 0 {-(_KNEE * h - shank_r)!r}"
        return (
            f'<body pos="0 {sign * 0.050 * h!r} 0">{joint(15.0, 1.9)}'
            + capsule(f"thigh_{side}", 0.100, thigh_m, f"0 0 {-0.02 * h!r}", f"0 0 {-0.21 * h!r}")
            + site(f"knee_{side}", knee_at)
            + f'<body pos="{knee_at}">{joint(4.0, 2.5)}'
            + capsule(f"shank_{side}", 0.061, shank_r, "0 0 0", sole)
            + site(f"foot_{side}", sole)
            + "</body></body>"
        )

    return (
        f'<body name="{name}"><freejoint/>'
        + capsule("pelvis", 0.142, 0.080 * h * girth, f"0 {-0.045 * h!r} {0.03 * h!r}", f"0 {0.045 * h!r} {0.03 * h!r}")
        + site("pelvis", "0 0 0")
        + f'<body pos="0 0 {(_LUMBAR - _HIP) * h!r}">{joint(30.0, 1.0, 60.0)}'
        + capsule("thorax", 0.355, trunk_m, f"0 0 {0.04 * h!r}", f"0 0 {0.12 * h!r}")
        + site("neck", f"0 0 {(_NECK - _LUMBAR) * h!r}")
        + f'<body pos="0 0 {(_NECK - _LUMBAR) * h!r}">{joint(8.0, 0.9, 20.0)}'
        + f'<geom name="{name}_head" type="sphere" size="{head_m!r}" pos="0 0 {(1 - _NECK) * h - head_m!r}" '
        + f'mass="{0.081 * m!r}" contype="0" conaffinity="0"/>'
        + site("head", f"0 0 {(1 - _NECK) * h - head_m!r}")
        + "</body>"
        + arm("l", 1.0)
        + arm("r", -1.0)
        + "</body>"
        + leg("l", 1.0)
        + leg("r", -1.0)
        + "</body>"
    )


def _bicycle_mjcf(name: str, size: float, mass_kg: float) -> tuple[str, list[str]]:
    """Return a bicycle: a frame from end to end at hub height, a seat post, a handlebar, and two wheels.

    Its own origin is on the road, in the middle of its length.
    """
    wheel_m, hub_m = 0.34 * size, 0.52 * size
    parts = (
        ("frame", 0.45, "capsule", 0.05, f"{-0.80 * size!r} 0 {wheel_m!r} {0.80 * size!r} 0 {wheel_m!r}"),
        ("post", 0.20, "capsule", 0.03, f"{-0.22 * size!r} 0 {wheel_m!r} {-0.25 * size!r} 0 {0.85 * size!r}"),
        ("bar", 0.15, "capsule", 0.02, f"{0.38 * size!r} -0.26 {1.0 * size!r} {0.38 * size!r} 0.26 {1.0 * size!r}"),
        ("front", 0.10, "cylinder", wheel_m, f"{hub_m!r} -0.005 {wheel_m!r} {hub_m!r} 0.005 {wheel_m!r}"),
        ("rear", 0.10, "cylinder", wheel_m, f"{-hub_m!r} -0.005 {wheel_m!r} {-hub_m!r} 0.005 {wheel_m!r}"),
    )
    geoms = "".join(
        f'<geom name="{name}_{part}" type="{shape}" size="{radius_m!r}" fromto="{ends}" mass="{share * mass_kg!r}" '
        'contype="0" conaffinity="0"/>'
        for part, share, shape, radius_m, ends in parts
    )
    sites = (
        f'<site name="{name}_at_front" pos="{hub_m!r} 0 {wheel_m!r}"/>'
        f'<site name="{name}_at_rear" pos="{-hub_m!r} 0 {wheel_m!r}"/>'
        f'<site name="{name}_at_top" pos="{0.38 * size!r} 0 {1.0 * size!r}"/>'
    )
    return f'<body name="{name}_ridden"><freejoint/>{geoms}{sites}</body>', [f"{name}_{part[0]}" for part in parts]


def _conveyance_mjcf(name: str, length_m: float, mass_kg: float) -> tuple[str, list[str]]:
    """Return a deck on the road, with its origin on the road in the middle."""
    ends = f"{-length_m / 2 + 0.04!r} 0 {DECK_M / 2!r} {length_m / 2 - 0.04!r} 0 {DECK_M / 2!r}"
    geom = (
        f'<geom name="{name}_frame" type="capsule" size="0.04" fromto="{ends}" mass="{mass_kg!r}" contype="0" '
        'conaffinity="0"/>'
    )
    sites = (
        f'<site name="{name}_at_front" pos="{length_m / 2!r} 0 {DECK_M / 2!r}"/>'
        f'<site name="{name}_at_rear" pos="{-length_m / 2!r} 0 {DECK_M / 2!r}"/>'
        f'<site name="{name}_at_top" pos="0 0 {DECK_M!r}"/>'
    )
    return f'<body name="{name}_ridden"><freejoint/>{geom}{sites}</body>', [f"{name}_frame"]
