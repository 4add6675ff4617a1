"""Directions and speeds of people who walk, run and ride: directions as seen from the striking vehicle.

A course, reported or possible, is relative to the vehicle: across its path from its left or right, along with it,
towards it, or none. It is read from the typing of the crash (``PEDCTYPE``, ``PEDSNR``, ``BIKECTYPE``) and the compass
directions (``PEDDIR``, ``MOTDIR``); else from the person's actions (``NMACTION``); else each course has its national
share. Sources: FARS/CRSS Pedestrian Bicyclist Crash Typing Manual; shares by the typing of one national year (2016:
8,008 pedestrians, 1,115 cyclists).

FARS codes no speed of a person. Sources, and how far each was checked:

* Walking in a crosswalk, adults up to 64: 4.3 ft/s, the mean of some 1,300 people who did not know they were observed
  (Carson, Accident Reconstruction Journal 34(5), 2024). From 65 on: 3.81 ft/s (Gates, Noyce, Bill and Van Ee,
  Transportation Research Record 1982, 2006, n = 326). Both lie between the 15th percentile and the mean of Knoblauch,
  Pietrucha and Nitzburg (TRR 1538, 1996: 15th percentiles 1.25 and 0.97 m/s), and above the 3.5 ft/s (1.07 m/s) to
  which the MUTCD times signals so that nearly everybody is across.
* Away from a crosswalk people walk 20 % faster than such studies say (Attalla and Kodsi, SAE 2013-01-0772, n = 304).
* Riding: 17.8 km/h, conventional bicycles in urban traffic (Twisk, Stelling et al., SWOV, naturalistic study).
* Animals: :mod:`trace_dag.simulation.body_sizes`.
* Running: NOT read from a table. Vaughan and Bain (SAE 1999-01-0440, 2000-01-0845) measured children and youths, whose
  numbers were not at hand; 3.5 m/s is a jog to an easy run, 2.5 m/s what is taken for people over 64.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trace_dag.common.units import METRES_PER_FOOT, kmh_to_mps
from trace_dag.crash.crash_types import Side, Turn
from trace_dag.crash.event_parties import StruckAnimal
from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import ImpactArea, NonMotorist
from trace_dag.crash.zones import is_in_crosswalk
from trace_dag.simulation.body_sizes import animal_speed_mps

OLD_YEARS: Final = 65
_WALKING_MPS: Final = 4.3 * METRES_PER_FOOT
_WALKING_OLD_MPS: Final = 3.81 * METRES_PER_FOOT
_AWAY_FROM_CROSSWALK: Final = 1.2
_RUNNING_MPS: Final = 3.5
_RUNNING_OLD_MPS: Final = 2.5
_RIDING_MPS: Final = kmh_to_mps(17.8)
_ROLLING_MPS: Final = 3.0  # on a skateboard or kick scooter; between walking and riding, judgement
_JOGGING: Final = 4  # NMACTION
_DASHED: Final = frozenset({1, 11})  # NMCC: darted or dashed out
_DASHES: Final = frozenset({741, 742})  # PEDCTYPE
_DASH_GROUP: Final = 740  # PEDCGP


class Course(StrEnum):
    """The direction in which a person moved, seen from the vehicle that struck it."""

    FROM_LEFT = "from_left"
    FROM_RIGHT = "from_right"
    ALONG = "along"  # in the vehicle's direction
    TOWARDS = "towards"  # against the vehicle's direction
    STANDING = "standing"


CROSSING: Final = frozenset({Course.FROM_LEFT, Course.FROM_RIGHT})
RELATIVE_DEG: Final[Mapping[Course, float]] = {
    Course.FROM_LEFT: -90.0,
    Course.FROM_RIGHT: 90.0,
    Course.ALONG: 0.0,
    Course.TOWARDS: 180.0,
}
"""Heading of the person less that of the vehicle, degrees counter-clockwise."""

COMPASS_DEG: Final[Mapping[int, float]] = {1: 90.0, 2: 0.0, 3: -90.0, 4: 180.0}
"""``PEDDIR``, ``MOTDIR``: degrees counter-clockwise from east."""

# --- what the codes say --------------------------------------------------------------------------------------------
_OF_PEDESTRIAN_TYPE: Final[Mapping[int, frozenset[Course]]] = {
    **dict.fromkeys((410, 430), frozenset({Course.ALONG})),  # struck from behind
    **dict.fromkeys((420, 440), frozenset({Course.TOWARDS})),  # struck from the front
    459: frozenset({Course.ALONG, Course.TOWARDS}),
    **dict.fromkeys((230, 311, 312, 313, 320, 330, 510, 520, 590, 610), frozenset({Course.STANDING})),
    **dict.fromkeys((341, 342, 461, 465, 469, 710, 730, 741, 742, 760, 770, 910), CROSSING),
    **dict.fromkeys((781, 782, 791, 792, 794, 795, 799), CROSSING),
}
_OF_PEDESTRIAN_GROUP: Final[Mapping[int, frozenset[Course]]] = {
    400: frozenset({Course.ALONG, Course.TOWARDS}),
    **dict.fromkeys((310, 500), frozenset({Course.STANDING})),
    **dict.fromkeys((340, 460, 720, 740, 750, 790, 910), CROSSING),
}
_OF_CYCLIST_TYPE: Final[Mapping[int, frozenset[Course]]] = {
    **dict.fromkeys(range(141, 181), CROSSING),
    **dict.fromkeys((211, 213, 214, 212, 217, 219), CROSSING),  # the motorist turned into the cyclist's path
    **dict.fromkeys((221, 222, 223, 224, 225), CROSSING),  # the cyclist turned into the motorist's path
    **dict.fromkeys((231, 232, 235, 239), frozenset({Course.ALONG})),
    **dict.fromkeys((241, 242, 243, 249), frozenset({Course.ALONG})),
    **dict.fromkeys((250, 255, 259), frozenset({Course.TOWARDS})),
    **dict.fromkeys(range(311, 330), CROSSING),
    **dict.fromkeys((357, 380), CROSSING),
}
_OF_CYCLIST_GROUP: Final[Mapping[int, frozenset[Course]]] = {
    **dict.fromkeys((140, 145, 150, 158, 190, 210, 215, 220, 225, 310, 320), CROSSING),
    **dict.fromkeys((230, 240), frozenset({Course.ALONG})),
    258: frozenset({Course.TOWARDS}),
}
_CROSSING_ACTION, _WITH_TRAFFIC, _AGAINST_TRAFFIC, _ALONG_ACTION = 3, 5, 6, 16  # NMACTION
_STANDING_ACTIONS: Final = frozenset({2, 8, 10, 11, 12})
_WITH, _FACING = 1, 2  # BIKEDIR
_SAME_WAY_FIRST: Final = frozenset({211, 213, 217})  # BIKECTYPE: both came along the same way, the motorist turned
_OTHER_WAY_FIRST: Final = frozenset({212, 214})

# --- shares where they say nothing -----------------------------------------------------------------------------------
_FROM_LEFT_SHARE: Final = 0.53  # 524 of 987 whose PEDSNR says the side
_PEDESTRIAN_SHARES: Final[Mapping[Course, float]] = {
    # 4,108 crossing, 1,197 along the road (731 from behind, 231 from the front), 659 in the roadway.
    Course.FROM_LEFT: 0.69 * _FROM_LEFT_SHARE,
    Course.FROM_RIGHT: 0.69 * (1 - _FROM_LEFT_SHARE),
    Course.ALONG: 0.15,
    Course.TOWARDS: 0.05,
    Course.STANDING: 0.11,
}
_CYCLIST_SHARES: Final[Mapping[Course, float]] = {
    # 508 on crossing ways or turning into one, 440 along (overtaken or parallel), 63 the wrong way.
    Course.FROM_LEFT: 0.25,
    Course.FROM_RIGHT: 0.25,
    Course.ALONG: 0.44,
    Course.TOWARDS: 0.06,
}
_ANIMAL_SHARES: Final[Mapping[Course, float]] = {Course.FROM_LEFT: 0.5, Course.FROM_RIGHT: 0.5}
"""No report tells from which side an animal came."""
_IN_A_MIRROR: Final = {Course.FROM_LEFT: Course.FROM_RIGHT, Course.FROM_RIGHT: Course.FROM_LEFT}
_SHARES: Final = {PartyKind.CYCLIST: _CYCLIST_SHARES, PartyKind.ANIMAL: _ANIMAL_SHARES}
_OTHER_SIDE: Final = -1.5
"""Log-likelihood of a person that came from the other side than that of the vehicle it was struck at."""
_AHEAD_RAD: Final = math.radians(46)  # the front and its corners, by :func:`trace_dag.common.geometry.body_bearing_rad`


@dataclass(frozen=True)
class CourseReading:
    """One course with its log-probability, and whether the report names it (perhaps among several)."""

    course: Course
    log_prior: float
    told: bool


def reported_directions(person: NonMotorist, turn: Turn | None) -> frozenset[Course]:
    """Return the courses that the report allows; empty if it is silent on the course.

    ``turn``: the turn of the vehicle.
    """
    allowed = _of_kind(person)
    side = _told_side(person, turn)
    if side is not None and (not allowed or not allowed.isdisjoint(CROSSING)):
        return frozenset({Course.FROM_LEFT if side is Side.LEFT else Course.FROM_RIGHT})
    if not allowed and turn is None:
        allowed = _of_compass(person)
    return allowed or _of_actions(person)


def readings(
    person: NonMotorist, turn: Turn | None, area: ImpactArea | None, *, keeps_left: bool = False
) -> tuple[CourseReading, ...]:
    """Return all possible courses, likeliest first; before the area of impact is weighed, their shares sum to 1.

    >>> found = readings(pedestrian_record.non_motorists[0], None, None)
    >>> round(sum(math.exp(reading.log_prior) for reading in found), 6)
    1.0
    """
    told = reported_directions(person, turn)
    shares = _SHARES.get(person.kind, _PEDESTRIAN_SHARES)
    if keeps_left:
        shares = {_IN_A_MIRROR.get(course, course): share for course, share in shares.items()}
    left = told or shares.keys()
    known = {course: share for course, share in shares.items() if course in left} or dict.fromkeys(left, 1.0)
    if turn is not None and not told:  # a turning vehicle seldom strikes somebody who walks along its road
        known = {course: share for course, share in known.items() if course in CROSSING} or known
    total = math.fsum(known.values())
    found = [
        CourseReading(course, math.log(share / total) + _side_term(course, area), bool(told))
        for course, share in known.items()
    ]
    return tuple(sorted(found, key=lambda reading: (-reading.log_prior, reading.course)))


def _of_kind(person: NonMotorist) -> frozenset[Course]:
    if person.kind is PartyKind.CYCLIST:
        by_type = _OF_CYCLIST_TYPE.get(person.cyclist_type_code or 0)
        found = by_type or _OF_CYCLIST_GROUP.get(person.cyclist_group_code or 0, frozenset())
        along = {_WITH: Course.ALONG, _FACING: Course.TOWARDS}.get(person.cyclist_direction_code or 0)
        return frozenset({along}) if not found and along is not None else found
    by_type = _OF_PEDESTRIAN_TYPE.get(person.pedestrian_type_code or 0)
    return by_type or _OF_PEDESTRIAN_GROUP.get(person.pedestrian_group_code or 0, frozenset())


def _told_side(person: NonMotorist, turn: Turn | None) -> Side | None:
    """Return the side of the vehicle's path from which the person came.

    It follows from ``PEDSNR``, else from the compass directions, else from the turn of one into the other's path.
    """
    if person.scenario and person.scenario[-1] in "ab":
        left = person.scenario[-1] == "a"
        number = int(person.scenario[:-1])
        if number in (
            7,
            8,
        ):  # turned right, far side: "a" went as the motorist did, so came from the right
            left = not left
        return Side.LEFT if left else Side.RIGHT
    relative = _compass_relative_deg(person)
    if relative is None:
        return _side_of_turn(person, turn)
    if turn in (Turn.LEFT, Turn.RIGHT) and relative in (0.0, 180.0):
        same = relative == 0.0
        return Side.LEFT if same is (turn is Turn.LEFT) else Side.RIGHT
    return {-90.0: Side.LEFT, 90.0: Side.RIGHT}.get(relative)


def _side_of_turn(person: NonMotorist, turn: Turn | None) -> Side | None:
    """Return the side of a person who goes straight on in the direction of a turning vehicle.

    A vehicle that turns left meets such a person from its left.
    """
    code = person.cyclist_type_code
    if turn not in (Turn.LEFT, Turn.RIGHT) or code not in _SAME_WAY_FIRST | _OTHER_WAY_FIRST:
        return None
    same = code in _SAME_WAY_FIRST
    return Side.LEFT if same is (turn is Turn.LEFT) else Side.RIGHT


def _compass_relative_deg(person: NonMotorist) -> float | None:
    """Return the direction of the person minus that of the motorist: 0, 90, 180 or -90 degrees.

    None if one of them is not coded.
    """
    of_person, of_motorist = (
        COMPASS_DEG.get(code or 0) for code in (person.pedestrian_direction_code, person.motorist_direction_code)
    )
    if of_person is None or of_motorist is None:
        return None
    relative = math.remainder(of_person - of_motorist, 360.0)
    return 180.0 if relative == -180.0 else relative


def _of_compass(person: NonMotorist) -> frozenset[Course]:
    relative = _compass_relative_deg(person)
    return frozenset(course for course, angle in RELATIVE_DEG.items() if angle == relative)


def _of_actions(person: NonMotorist) -> frozenset[Course]:
    actions = frozenset(person.actions)
    if _CROSSING_ACTION in actions:
        return CROSSING
    if _WITH_TRAFFIC in actions:
        return frozenset({Course.ALONG})
    if _AGAINST_TRAFFIC in actions:
        return frozenset({Course.TOWARDS})
    if _ALONG_ACTION in actions:
        return frozenset({Course.ALONG, Course.TOWARDS})
    return frozenset({Course.STANDING}) if actions & _STANDING_ACTIONS else frozenset()


def _side_term(course: Course, area: ImpactArea | None) -> float:
    """Return the log-likelihood of a course given the struck side: a person from one side rarely strikes the other."""
    if area is None or course not in CROSSING or abs(area.centre_rad) < _AHEAD_RAD / 3:
        return 0.0
    on_left = area.centre_rad > 0
    agrees = on_left is (course is Course.FROM_LEFT)
    if agrees:
        return 0.0
    return _OTHER_SIDE if abs(area.centre_rad) > _AHEAD_RAD else _OTHER_SIDE / 3


# --- speeds ----------------------------------------------------------------------------------------------------------
class Gait(StrEnum):
    """Gaits of a person or an animal."""

    STANDING = "standing"
    WALKING = "walking"
    RUNNING = "running"
    RIDING = "riding"
    TROTTING = "trotting"  # from here on: animals
    GALLOPING = "galloping"


def gait_of(person: NonMotorist) -> Gait:
    """Return the gait: running if that is reported, riding if the person rode something, else walking.

    >>> gait_of(pedestrian_record.non_motorists[0]).value  # PEDCTYPE 760: failed to yield, no dash
    'walking'
    """
    if isinstance(person, StruckAnimal):
        return Gait(person.pace)
    if person.kind in (PartyKind.CYCLIST, PartyKind.CONVEYANCE):
        return Gait.RIDING
    return Gait.RUNNING if dashes(person) or _JOGGING in person.actions else Gait.WALKING


def dashes(person: NonMotorist) -> bool:
    """Return whether the person ran out into the road."""
    by_type = person.pedestrian_type_code in _DASHES or person.pedestrian_group_code == _DASH_GROUP
    return by_type or not _DASHED.isdisjoint(person.circumstances)


def usual_speed_mps(person: NonMotorist, gait: Gait) -> float:
    """Return the usual speed of a person of that age (years) with that gait, m/s.

    >>> usual_speed_mps(pedestrian_record.non_motorists[0], Gait.STANDING)
    0.0
    """
    if isinstance(person, StruckAnimal):
        return animal_speed_mps(person.species, person.pace)
    old = person.age_years is not None and person.age_years >= OLD_YEARS
    if gait is Gait.STANDING:
        return 0.0
    if gait is Gait.RUNNING:
        return _RUNNING_OLD_MPS if old else _RUNNING_MPS
    if gait is Gait.RIDING:
        return _RIDING_MPS if person.kind is PartyKind.CYCLIST else _ROLLING_MPS
    return (_WALKING_OLD_MPS if old else _WALKING_MPS) * (1.0 if is_in_crosswalk(person) else _AWAY_FROM_CROSSWALK)
