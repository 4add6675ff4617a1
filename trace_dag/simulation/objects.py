"""Fixed objects: each kind that a report can name as a body, and where beside a road it usually stands.

A rigid object stops a vehicle. A yielding one resists with a force, and breaks after it has absorbed an energy. One
that is driven over absorbs little. Ditches and embankments are slopes of the ground: the outline of a ditch is its far
side, from its bottom up to the height of the ground before it, that of an embankment is its face. Sources of strengths:

* Supports of signs, lights and mailboxes: a breakaway support may slow a car of 820 kg from 35 km/h down by 5 m/s, and
should by 3 m/s at most (NCHRP Report 350, 1993, section 5.1), which takes 20 kJ. * Guardrails: a strong-post W-beam
guardrail that a pickup of 2000 kg strikes at 100 km/h and 25 degrees (test 3-11) bends by 0.7 to 1.1 m. Concrete
barriers do not bend. * Trees, walls, piers and buildings are rigid, utility poles too: few break at the speeds of
passenger cars. * Soil (the ground, snow): what brakes a vehicle that digs into it with its front, judgement.

Distances beyond the edge of the carriageway: signs 3.6 m (MUTCD, 2009, section 2A.19: 12 ft), guardrails and barriers
at the back of the shoulder (AASHTO, Roadside Design Guide, 2011, section 5.6.1), kerbs at the edge; the others are
judgement within the clear zone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trace_dag.common.geometry import Pose


class Resistance(StrEnum):
    """Effects of objects on a vehicle that strikes them."""

    RIGID = "rigid"
    YIELDING = "yielding"
    DRIVEN_OVER = "driven_over"
    SLOPE = "slope"  # ground that falls and rises to the left of its heading: see :mod:`.roadside_terrain`


class ObjectForm(StrEnum):
    """The shape of an object seen from above."""

    POST = "post"  # compact, struck wherever the vehicle meets it
    LINE = "line"  # runs along the road, or along its end


class PlacedBy(StrEnum):
    """Origins of an object's place."""

    PROGRAM = "program"  # placed to fit the reported area of impact: the map has none there
    OPENSTREETMAP = "openstreetmap"


@dataclass(frozen=True)
class ObjectKind:
    """A kind of object: length along the road, width and height (m), strength, and usual distance.

    The distance is that of its face from the edge of the carriageway.
    """

    name: str
    form: ObjectForm
    length_m: float
    width_m: float
    height_m: float
    resistance: Resistance
    beyond_edge_m: float
    force_n: float | None = None
    energy_j: float | None = None


@dataclass(frozen=True)
class FixedObject:
    """An object of a hypothesis: the party's number, the pose of its middle, and its kind.

    The heading is along its length. ``code`` is its ``SOE``, ``placed_by`` the origin of its place, ``osm_id`` its
    element in OpenStreetMap ("node/12"). ``force_n`` is its largest resistance, None for rigid objects; ``energy_j`` is
    the energy needed to break or pass it, None if that is impossible.
    """

    number: int
    event_number: int
    code: int
    name: str
    pose: Pose
    length_m: float
    width_m: float
    height_m: float
    resistance: Resistance
    force_n: float | None = None
    energy_j: float | None = None
    placed_by: PlacedBy = PlacedBy.PROGRAM
    osm_id: str = ""

    @classmethod
    def of_kind(
        cls,
        code: int,
        *,
        number: int,
        event_number: int,
        pose: Pose,
        length_m: float | None = None,
        width_m: float | None = None,
    ) -> FixedObject:
        """Return an object of the kind of an ``SOE``, of the usual size unless given."""
        kind = KINDS[code]
        return cls(
            number=number,
            event_number=event_number,
            code=code,
            name=kind.name,
            pose=pose,
            length_m=kind.length_m if length_m is None else length_m,
            width_m=kind.width_m if width_m is None else width_m,
            height_m=kind.height_m,
            resistance=kind.resistance,
            force_n=kind.force_n,
            energy_j=kind.energy_j,
        )


_POST, _LINE = ObjectForm.POST, ObjectForm.LINE
_RIGID, _YIELDING = Resistance.RIGID, Resistance.YIELDING
_DRIVEN_OVER, _SLOPE = Resistance.DRIVEN_OVER, Resistance.SLOPE
_BREAKAWAY: Final = (60e3, 20e3)
_GUARDRAIL_N: Final = 80e3
_LONG_M: Final = 40.0

KINDS: Final[Mapping[int, ObjectKind]] = {
    18: ObjectKind("object on the road", _POST, 0.6, 0.6, 0.5, _YIELDING, 0.2, 15e3, 10e3),
    91: ObjectKind("object on the road", _POST, 0.6, 0.6, 0.5, _YIELDING, 0.2, 15e3, 10e3),
    17: ObjectKind("boulder", _POST, 1.0, 1.0, 0.8, _RIGID, 3.0),
    19: ObjectKind("building", _POST, 8.0, 8.0, 5.0, _RIGID, 8.0),
    20: ObjectKind("crash cushion", _POST, 2.5, 0.9, 0.9, _YIELDING, 1.0, 90e3, 500e3),
    21: ObjectKind("bridge pier", _POST, 1.2, 1.2, 5.0, _RIGID, 3.0),
    23: ObjectKind("bridge rail", _LINE, _LONG_M, 0.4, 0.9, _RIGID, 0.9),
    24: ObjectKind("guardrail", _LINE, _LONG_M, 0.4, 0.8, _YIELDING, 1.2, _GUARDRAIL_N),
    25: ObjectKind("concrete barrier", _LINE, _LONG_M, 0.5, 0.9, _RIGID, 1.2),
    26: ObjectKind("traffic barrier", _LINE, _LONG_M, 0.4, 0.8, _YIELDING, 1.2, _GUARDRAIL_N),
    30: ObjectKind("utility pole or light support", _POST, 0.3, 0.3, 9.0, _RIGID, 2.0),
    31: ObjectKind("post or pole", _POST, 0.15, 0.15, 3.0, _YIELDING, 2.0, *_BREAKAWAY),
    32: ObjectKind("culvert", _POST, 1.5, 1.0, 0.6, _RIGID, 2.5),
    33: ObjectKind("curb", _LINE, _LONG_M, 0.2, 0.15, _DRIVEN_OVER, 0.1),
    34: ObjectKind("ditch", _LINE, _LONG_M, 1.8, 0.6, _SLOPE, 2.0),
    35: ObjectKind("embankment", _LINE, _LONG_M, 3.0, 1.5, _SLOPE, 2.5),
    38: ObjectKind("fence", _LINE, _LONG_M, 0.1, 1.5, _YIELDING, 4.0, 20e3, 5e3),
    39: ObjectKind("wall", _LINE, 20.0, 0.3, 2.0, _RIGID, 5.0),
    40: ObjectKind("fire hydrant", _POST, 0.3, 0.3, 0.8, _YIELDING, 1.2, *_BREAKAWAY),
    41: ObjectKind("shrubbery", _POST, 1.5, 1.5, 1.2, _DRIVEN_OVER, 2.5),
    42: ObjectKind("tree", _POST, 0.4, 0.4, 8.0, _RIGID, 3.5),
    43: ObjectKind("other fixed object", _POST, 0.6, 0.6, 1.2, _RIGID, 2.5),
    44: ObjectKind("pavement irregularity", _LINE, 6.0, 1.0, 0.05, _DRIVEN_OVER, 0.2),
    46: ObjectKind("traffic signal support", _POST, 0.3, 0.3, 6.0, _RIGID, 1.5),
    48: ObjectKind("snow bank", _LINE, _LONG_M, 2.0, 0.8, _YIELDING, 1.0, 25e3, 60e3),
    50: ObjectKind("overhead bridge structure", _POST, 1.2, 1.2, 5.0, _RIGID, 2.0),
    52: ObjectKind("guardrail end", _POST, 1.0, 0.5, 0.8, _YIELDING, 1.5, 80e3, 120e3),
    53: ObjectKind("mailbox", _POST, 0.3, 0.3, 1.2, _YIELDING, 0.6, *_BREAKAWAY),
    57: ObjectKind("cable barrier", _LINE, _LONG_M, 0.2, 0.8, _YIELDING, 2.4, 45e3),
    58: ObjectKind("ground", _LINE, 20.0, 3.0, 0.3, _YIELDING, 1.0, 25e3, 90e3),
    59: ObjectKind("traffic sign support", _POST, 0.15, 0.15, 2.5, _YIELDING, 3.6, *_BREAKAWAY),
    93: ObjectKind("unknown fixed object", _POST, 0.6, 0.6, 1.2, _RIGID, 2.5),
}
"""By ``SOE``: every code of a fixed object, and of one that lay on the road."""

_DITCH: Final = 34


def base_m(item: FixedObject) -> float:
    """Return the height of an object's lowest point relative to the ground before it (m); 0 except for ditches.

    >>> from trace_dag.common.geometry import Pose
    >>> ditch = FixedObject(1001, 1, 34, "ditch", Pose(0.0, 0.0, 0.0), 20.0, 2.0, 0.8, Resistance.SLOPE)  # SOE 34
    >>> base_m(ditch)  # 0.8 m deep
    -0.8
    """
    return -item.height_m if item.code == _DITCH else 0.0


def slope_profile_m(item: FixedObject) -> tuple[tuple[float, float], ...]:
    """Return heights of the ground (m, second of each) at distances to the left of a slope's heading (m).

    It is straight between them, and level before the first and beyond the last.

    A ditch falls and rises by the same amount, up to its outline and over it. An embankment rises over its outline.

    >>> from trace_dag.common.geometry import Pose
    >>> ditch = FixedObject(1001, 1, 34, "ditch", Pose(0.0, 0.0, 0.0), 20.0, 2.0, 0.8, Resistance.SLOPE)  # SOE 34
    >>> slope_profile_m(ditch)  # 2 m down, 2 m up again
    ((-3.0, 0.0), (-1.0, -0.8), (1.0, 0.0))
    """
    near_m, far_m = -item.width_m / 2, item.width_m / 2
    if item.code == _DITCH:
        return (near_m - item.width_m, 0.0), (near_m, -item.height_m), (far_m, 0.0)
    return (near_m, 0.0), (far_m, item.height_m)
