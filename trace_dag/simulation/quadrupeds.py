"""An animal in MuJoCo: ten jointed segments on four legs.

Segments: the trunk, neck with head, and of each leg the part above the knee or hock and the part below. The joints are
passive, as those of :mod:`trace_dag.simulation.figures`. Shares of the mass and the proportions are roughly those of
standing grazing animals; the throw depends on the mass and the height of the trunk, and little on these. It trots: a
stride is 2.3 times the height of the hip by the Froude number to the power of 0.3 (Alexander, Nature 261, 1976), legs
across from each other go together.

Axes of the figure: ahead, left, up. The root is the middle of the trunk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.body_sizes import HIP
from trace_dag.simulation.figure_parts import FigureParts
from trace_dag.simulation.types import Body

SEGMENTS = (
    *("trunk", "neck", "head"),
    *(f"{part}_{leg}" for leg in ("fl", "fr", "hl", "hr") for part in ("upper", "lower")),
)
"""``fl`` is the left foreleg, ``hr`` the right hind leg."""
LANDMARKS = (
    *("rump", "withers", "poll", "nose"),
    *(f"{part}_{leg}" for leg in ("fl", "fr", "hl", "hr") for part in ("knee", "foot")),
)
"""Points of an animal that a log keeps, in this order; a hind leg's knee is its hock."""
DEGREES = (7 + 4 * 9, 6 + 3 * 9)
"""Numbers in a figure's pose and in its rates: a free root and nine ball joints."""
KNEE = 0.30
"""Height of knees and hocks, of that of the withers."""

_REFERENCE_KGM2 = 240.0  # as of people: mass times height squared, by which the joints' resistance is scaled
_STANDS_MPS = 0.2
_LONGEST_SWING_RAD = 0.4
_SWINGS = {"fl": 1.0, "fr": -1.0, "hl": -1.0, "hr": 1.0}
_MASS = {"trunk": 0.70, "neck": 0.06, "head": 0.04, "upper": 0.035, "lower": 0.015}


@dataclass(frozen=True)
class Build:
    """The build of an animal: places of its parts and radii, all in metres.

    Places are ahead of the middle of the trunk and above the road.
    """

    trunk_m: float  # radius of the trunk
    rump_m: float
    chest_m: float
    root_m: float  # height of the middle of the trunk
    hip_m: float  # height of the joints of the legs
    sole_m: float  # radius of a foot
    knee_m: float
    fore_m: float
    hind_m: float
    aside_m: float

    def leg_ahead_m(self, leg: str) -> float:
        """Return the place along the trunk of a leg's joint."""
        return self.fore_m if leg.startswith("f") else self.hind_m


def build(body: Body) -> Build:
    """Return the build of an animal of a length from nose to rump, a width, and a height at the withers.

    >>> from trace_dag.simulation.types import BodyKind, VehicleClass
    >>> made = build(Body(BodyKind.ANIMAL, VehicleClass.OTHER, 1.8, 0.4, 1.0, 70.0))
    >>> round(made.root_m + made.trunk_m, 6)  # up to the withers
    1.0
    """
    trunk_m = body.width_m / 2
    rump_m, chest_m = -0.36 * body.length_m, 0.22 * body.length_m
    root_m = body.height_m - trunk_m
    return Build(
        trunk_m,
        rump_m,
        chest_m,
        root_m,
        root_m - 0.4 * trunk_m,
        0.03 * body.height_m,
        KNEE * body.height_m,
        chest_m - 0.8 * trunk_m,
        rump_m + 0.8 * trunk_m,
        0.5 * trunk_m,
    )


@dataclass(frozen=True)
class Stance:
    """The stance of an animal: angles of the legs about the left axis (rad), in the order fl, fr, hl, hr.

    Angles are positive backward.

    The trunk is level.
    """

    legs: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    pelvis = 0.0

    def root_height_m(self, b: Build) -> float:
        """Return the height of the middle of the trunk, with the lowest foot on the road."""
        reach_m = max((b.hip_m - b.sole_m) * math.cos(angle) for angle in self.legs)
        return b.root_m - b.hip_m + b.sole_m + reach_m

    def pose(self) -> list[float]:
        """Return the joint positions for MuJoCo, without the root's: neck, then each leg's upper joint and knee."""
        upright = [1.0, 0.0, 0.0, 0.0]
        joints = [upright]
        for angle in self.legs:
            joints += [[math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0], upright]
        return [value for joint in joints for value in joint]


def trotting(height_m: float, speed_mps: float, travelled_m: float) -> Stance:
    """Return the stance of an animal of a height at the withers, at a speed, after a distance."""
    if speed_mps < _STANDS_MPS:
        return Stance()
    hip_m = HIP * height_m
    step_m = 2.3 * hip_m * (speed_mps**2 / (GRAVITY_MPS2 * hip_m)) ** 0.3 / 2
    swing = min(_LONGEST_SWING_RAD, math.asin(min(0.9, step_m / 2 / hip_m)))
    angle = swing * math.cos(math.pi * travelled_m / step_m)
    one, two, three, four = (sense * angle for sense in _SWINGS.values())
    return Stance((one, two, three, four))


def figure_mjcf(name: str, body: Body) -> tuple[str, list[str]]:
    """Return an animal as MJCF, with the names of its segments.

    >>> from trace_dag.simulation.types import BodyKind, VehicleClass
    >>> mjcf, segments = figure_mjcf("deer", Body(BodyKind.ANIMAL, VehicleClass.OTHER, 1.8, 0.4, 1.0, 70.0))
    >>> all(name in mjcf for name in segments), "deer_head" in segments
    (True, True)
    """
    b, h, m = build(body), body.height_m, body.mass_kg
    stiff = m * h * h / _REFERENCE_KGM2

    parts = FigureParts(name, m, stiff)
    joint, capsule, site = parts.joint, parts.capsule, parts.site

    poll, nose = (
        f"{0.16 * body.length_m!r} 0 {0.30 * h!r}",
        f"{0.28 * body.length_m!r} 0 {0.22 * h!r}",
    )
    neck = (
        f'<body pos="{b.chest_m - 0.6 * b.trunk_m!r} 0 {0.5 * b.trunk_m!r}">{joint(12.0, 1.2, 30.0)}'
        + capsule("neck", _MASS["neck"], 0.35 * b.trunk_m, "0 0 0", poll)
        + capsule("head", _MASS["head"], 0.30 * b.trunk_m, poll, nose)
        + site("poll", poll)
        + site("nose", nose)
        + "</body>"
    )

    def leg(which: str, sign: float) -> str:
        upper_m, sole_m = b.hip_m - b.knee_m, b.sole_m
        knee, foot = f"0 0 {-upper_m!r}", f"0 0 {-(b.knee_m - sole_m)!r}"
        return (
            f'<body pos="{b.leg_ahead_m(which)!r} {sign * b.aside_m!r} {b.hip_m - b.root_m!r}">{joint(15.0, 1.6)}'
            + capsule(f"upper_{which}", _MASS["upper"], 0.055 * h, "0 0 0", knee)
            + site(f"knee_{which}", knee)
            + f'<body pos="{knee}">{joint(4.0, 2.0)}'
            + capsule(f"lower_{which}", _MASS["lower"], sole_m, "0 0 0", foot)
            + site(f"foot_{which}", foot)
            + "</body></body>"
        )

    legs = "".join(leg(which, 1.0 if which.endswith("l") else -1.0) for which in _SWINGS)
    back, front = b.rump_m + b.trunk_m, b.chest_m - b.trunk_m
    xml = (
        f'<body name="{name}"><freejoint/>'
        + capsule("trunk", _MASS["trunk"], b.trunk_m, f"{back!r} 0 0", f"{front!r} 0 0")
        + site("rump", f"{back!r} 0 0")
        + site("withers", f"{front!r} 0 0")
        + neck
        + legs
        + "</body>"
    )
    return xml, [f"{name}_{segment}" for segment in SEGMENTS]
