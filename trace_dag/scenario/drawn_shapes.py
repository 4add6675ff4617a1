"""Shapes and colours for pictures, replays and sketches: people and animals from above, outlines of fixed objects.

A figure has head, body, limbs and mount. If a log has the landmarks of a jointed figure, that figure is drawn,
standing, riding or thrown. Without them, and for plans, the figure stands upright or rides along the heading.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.common.geometry import FloatArray, rectangle_corners
from trace_dag.crash.parties import party_of_body
from trace_dag.simulation import quadrupeds
from trace_dag.simulation.figures import LANDMARKS, PLACE_OF_LANDMARK
from trace_dag.simulation.objects import FixedObject, PlacedBy, Resistance, slope_profile_m
from trace_dag.simulation.types import BodyKind

if TYPE_CHECKING:
    from trace_dag.simulation.types import Body, VehicleLog

_LIMBS: Final = (("neck", "hand_l"), ("neck", "hand_r"), ("pelvis", "knee_l"), ("knee_l", "foot_l"))
_LIMBS_RIGHT: Final = (("pelvis", "knee_r"), ("knee_r", "foot_r"))
_SHOULDERS: Final = 0.25  # of the stature, from side to side
_HUB: Final = 0.30  # of a bicycle's length: a hub off the middle
_BAR_M: Final = 0.52
_HEAD_M, _TORSO_M, _LIMB_M, WHEEL_M = 0.13, 0.30, 0.12, 0.09
"""Radius of a head and widths of torso, limbs and wheels from above."""
_OF_ANIMALS: Final = {name: k for k, name in enumerate(quadrupeds.LANDMARKS)}
_LEGS: Final = ("fl", "fr", "hl", "hr")
_TRUNK, _NECK, _LEG, _SKULL = 0.85, 0.40, 0.17, 0.22  # widths of an animal's parts and its head's radius, of its own
_SPINE: Final = (-0.23, 0.10)  # of an animal's length: its rump and withers
_NOSE: Final = 0.46
_LEAST_M: Final = 0.5  # nothing thinner is drawn
_ROUND_M: Final = 1.0  # compact objects smaller than this are drawn round
OBJECT_NOTE: Final = "placed by the program: the map has none of the kind there"
VEHICLE_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#F0E442", "#56B4E9")
"""Okabe and Ito's palette: told apart with every common kind of colour vision. Vehicle 1 is blue, 2 vermilion."""
REPORTED_COLOUR: Final = "#000000"
CONTACT_COLOUR: Final = "#B00020"
OBJECT_COLOUR: Final = "#6B4A2B"
"""Colour of fixed objects: brown, with a broken outline where the program placed them."""


@dataclass(frozen=True, eq=False)
class FigureShape:
    """Lines and places from above, metres in the local frame.

    ``torso`` and ``shoulders`` (2, 2), ``limbs`` (n, 2, 2), ``head`` (2,), ``ridden`` (n, 2, 2): wheels or deck, and
    handlebar. For an animal ``shoulders`` is the neck.

    ``widths_m`` are those of torso, shoulders and limbs, ``head_m`` the radius of the head.
    """

    torso: FloatArray
    shoulders: FloatArray
    limbs: FloatArray
    head: FloatArray
    ridden: FloatArray
    widths_m: tuple[float, float, float] = (_TORSO_M, _TORSO_M * 0.8, _LIMB_M)
    head_m: float = _HEAD_M

    @property
    def lines(self) -> list[tuple[FloatArray, float]]:
        """Return the body's lines with their widths (m), lower ones first."""
        torso_m, shoulders_m, limb_m = self.widths_m
        return [*((limb, limb_m) for limb in self.limbs), (self.torso, torso_m), (self.shoulders, shoulders_m)]


def logged_shape(log: VehicleLog, k: int, body: Body) -> FigureShape:
    """Return a person or an animal in the ``k``-th state of a log."""
    place = np.array([log.x_m[k], log.y_m[k]])
    heading = float(log.heading_rad[k])
    if not log.landmarks_m.shape[1]:
        return upright_shape(place, heading, body)
    points = log.landmarks_m[k].reshape(-1, 3)[:, :2] + place
    if body.kind is BodyKind.ANIMAL:
        return _animal({name: points[index] for name, index in _OF_ANIMALS.items()}, body)

    def at(name: str) -> FloatArray:
        return np.asarray(points[PLACE_OF_LANDMARK[name]])

    pelvis, neck = at("pelvis"), at("neck")
    lying = neck - pelvis
    along = lying / np.hypot(*lying) if np.hypot(*lying) > 0.12 * body.height_m else np.array(_ahead(heading))
    return FigureShape(
        torso=np.array([pelvis, neck]),
        shoulders=_across(neck, along, body),
        limbs=np.array([(at(one), at(two)) for one, two in (*_LIMBS, *_LIMBS_RIGHT)]),
        head=at("head"),
        ridden=_ridden(at("front"), at("rear"), at("top"), body)
        if len(points) > len(LANDMARKS)
        else np.empty((0, 2, 2)),
    )


def upright_shape(place: FloatArray, heading_rad: float, body: Body) -> FigureShape:
    """Return a person who stands upright or rides at a place, with a heading; or an animal."""
    along = np.array(_ahead(heading_rad))
    left = np.array([-along[1], along[0]])
    if body.kind is BodyKind.ANIMAL:
        return _standing_animal(place, along, left, body)
    rides = body.kind is not BodyKind.PEDESTRIAN
    foot = 0.12 * body.height_m
    feet = np.array([place + foot * along + 0.09 * left, place - foot * along - 0.09 * left])
    hub = _HUB * body.length_m * along
    bar = place + 0.22 * body.length_m * along
    return FigureShape(
        torso=np.array([place, place]),
        shoulders=_across(place, along, body),
        limbs=np.array([[place, each] for each in feet]),
        head=place + 0.05 * along,
        ridden=_ridden(place + hub, place - hub, bar, body) if rides else np.empty((0, 2, 2)),
    )


def _ahead(heading_rad: float) -> tuple[float, float]:
    return math.cos(heading_rad), math.sin(heading_rad)


def _across(place: FloatArray, along: FloatArray, body: Body) -> FloatArray:
    half = _SHOULDERS * body.height_m / 2 * np.array([-along[1], along[0]])
    return np.array([place + half, place - half])


def _ridden(front: FloatArray, rear: FloatArray, top: FloatArray, body: Body) -> FloatArray:
    """Return wheels and frame as one line, a wheel longer than the distance between hubs, and a bicycle's handlebar."""
    way = front - rear
    length_m = float(np.hypot(*way))
    along = way / length_m if length_m > 0.05 else np.array([1.0, 0.0])
    if body.kind is not BodyKind.CYCLIST:
        return np.array([[rear, front]])
    wheel = 0.34 * along
    half = _BAR_M / 2 * np.array([-along[1], along[0]])
    return np.array(
        [[rear - wheel, rear + wheel], [rear, front], [front - wheel, front + wheel], [top + half, top - half]]
    )


def _standing_animal(place: FloatArray, along: FloatArray, left: FloatArray, body: Body) -> FigureShape:
    rump, withers = (place + share * body.length_m * along for share in _SPINE)
    points = {"rump": rump, "withers": withers, "nose": place + _NOSE * body.length_m * along}
    points["poll"] = withers + 0.6 * (points["nose"] - withers)
    for leg in _LEGS:
        joint = withers if leg.startswith("f") else rump
        foot = joint + (0.3 if leg.endswith("l") else -0.3) * body.width_m * left
        points |= {f"knee_{leg}": (joint + foot) / 2, f"foot_{leg}": foot}
    return _animal(points, body)


def _animal(at: dict[str, FloatArray], body: Body) -> FigureShape:
    legs = []
    for leg in _LEGS:
        joint = at["withers" if leg.startswith("f") else "rump"]
        legs += [(joint, at[f"knee_{leg}"]), (at[f"knee_{leg}"], at[f"foot_{leg}"])]
    return FigureShape(
        torso=np.array([at["rump"], at["withers"]]),
        shoulders=np.array([at["withers"], at["poll"]]),
        limbs=np.array(legs),
        head=(at["poll"] + at["nose"]) / 2,
        ridden=np.empty((0, 2, 2)),
        widths_m=(_TRUNK * body.width_m, _NECK * body.width_m, _LEG * body.width_m),
        head_m=_SKULL * body.width_m,
    )


# --- fixed objects ---------------------------------------------------------------------------------------------------
def outline(item: FixedObject) -> FloatArray:
    """Return corners of an object seen from above, shape (n, 2); for a ditch or embankment, of the whole slope.

    >>> from trace_dag.common.geometry import Pose
    >>> barrier = FixedObject(1001, 1, 25, "concrete barrier", Pose(0.0, 0.0, 0.0), 20.0, 2.0, 1.0, Resistance.RIGID)
    >>> float(np.ptp(outline(barrier)[:, 0]))
    20.0
    """
    if item.resistance is Resistance.SLOPE:
        (near_m, _), *_, (far_m, _) = slope_profile_m(item)
        middle = item.pose.to_world(np.array([0.0, (near_m + far_m) / 2]))
        pose = replace(item.pose, x_m=float(middle[0]), y_m=float(middle[1]))
        return rectangle_corners(pose, item.length_m, far_m - near_m)
    length_m, width_m = max(item.length_m, _LEAST_M), max(item.width_m, _LEAST_M)
    if max(item.length_m, item.width_m) < _ROUND_M:
        angles = np.linspace(0.0, 2 * np.pi, 13)[:-1]
        return item.pose.xy_m + np.column_stack([np.cos(angles), np.sin(angles)]) * max(length_m, width_m) / 2
    return rectangle_corners(item.pose, length_m, width_m)


def is_ours(item: FixedObject) -> bool:
    """Return whether the program placed the object."""
    return item.placed_by is PlacedBy.PROGRAM


def describe_object(item: FixedObject) -> str:
    """Return the object's kind and the origin of its place.

    >>> describe_object(tree)
    'tree (placed by the program: the map has none of the kind there)'
    """
    return f"{item.name} ({OBJECT_NOTE if is_ours(item) else 'OpenStreetMap ' + item.osm_id})"


def names(items: Iterable[FixedObject]) -> str:
    """Return the names of some objects, without repetitions, in their order.

    >>> names([tree, tree])
    'tree'
    """
    return ", ".join(dict.fromkeys(item.name for item in items))


_CATEGORIES: Final = {
    **dict.fromkeys((23, 24, 25, 26, 57), "barrier"),
    **dict.fromkeys((19, 21, 50), "building"),
    **dict.fromkeys((30, 31, 46, 59), "pole"),
    42: "tree",
    41: "vegetation",
}


def object_category(item: FixedObject) -> str:
    """Return the object's category, common to OpenDRIVE (``e_objectType``) and OpenSCENARIO (``MiscObjectCategory``).

    >>> object_category(tree)
    'tree'
    """
    return _CATEGORIES.get(item.code, "obstacle")


def vehicle_colour(index: int) -> str:
    """Return the colour of the vehicle that is the ``index``-th by number, from 0.

    >>> vehicle_colour(0), vehicle_colour(6)  # six of them, then from the start
    ('#0072B2', '#0072B2')
    """
    return VEHICLE_COLOURS[index % len(VEHICLE_COLOURS)]


def body_colour(number: int, numbers: Iterable[int]) -> str:
    """Return the colour of a body among those of a simulation; a trailer has that of its vehicle."""
    return vehicle_colour(list(numbers).index(party_of_body(number)))
