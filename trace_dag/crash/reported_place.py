"""Places that a report gives in words: a crossing of two streets or a distance from it, and names of states."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

from trace_dag.common.errors import UserError
from trace_dag.crash.codes.elements import STATES
from trace_dag.crash.record import Octant

_ABBREVIATIONS: Final = (
    "AL AK AZ AR CA CO CT DE DC FL GA HI ID IL IN IA KS KY LA ME MD MA MI MN MS MO MT NE NV NH NJ NM NY NC ND OH OK OR "
    "PA PR RI SC SD TN TX UT VT VA VI WA WV WI WY"  # in the order of the codes
)
_POSTAL: Final = dict(
    zip(
        STATES,
        _ABBREVIATIONS.split(),
        strict=True,
    )
)
_BY_NAME: Final = {name.casefold(): code for names in (STATES, _POSTAL) for code, name in names.items()}


class Place(NamedTuple):
    """A point, WGS84 degrees."""

    latitude_deg: float
    longitude_deg: float


class FromCrossing(NamedTuple):
    """A place on ``street``: ``distance_m`` from the crossing with ``cross_street``, in a direction of the compass.

    Without a direction it is the crossing itself.
    """

    street: str
    cross_street: str
    distance_m: float = 0.0
    direction: Octant | None = None

    @classmethod
    def said(cls, street: str, cross_street: str, distance_m: float, direction: Octant | None) -> FromCrossing | None:
        """Return the place, or None if a street is missing, or the direction of a distance."""
        if not street or not cross_street or (distance_m and direction is None):
            return None
        return cls(street, cross_street, distance_m, direction) if distance_m else cls(street, cross_street)


PlaceFinder: TypeAlias = Callable[[Collection[FromCrossing]], Mapping[FromCrossing, Sequence[Place]]]
"""Finds such places on maps: none where they are not, several where they are more than once."""


def look_up(
    wanted: Mapping[str, FromCrossing | None], find: PlaceFinder | None
) -> tuple[dict[str, Place], dict[str, str]]:
    """Return the place of each report by its name, and for the others the reason why it is unknown.

    A value None means that the report's words give no place.
    """
    found = find({each for each in wanted.values() if each is not None}) if find is not None else {}
    places, unknown = {}, {}
    for name, each in wanted.items():
        here = found.get(each, []) if each is not None else []
        if len(here) == 1:
            places[name] = here[0]
        elif each is None:
            unknown[name] = "no latitude and longitude, and no two streets, or no direction of a distance"
        elif find is None:
            unknown[name] = "no latitude and longitude, and no --maps where its streets are looked up"
        else:
            where = f"{len(here)} places of" if here else "nowhere on"
            unknown[name] = f"no latitude and longitude, and its streets lead to {where} the maps given"
    return places, unknown


# --- states ----------------------------------------------------------------------------------------------------------
def state_code(text: str) -> int:
    """Return the ``STATE`` code of a state given as code, postal abbreviation or name.

    Raises UserError for other text.

    >>> state_code('VA'), state_code('virginia'), state_code('51')
    (51, 51, 51)
    """
    if text.isascii() and text.isdigit() and int(text) in STATES:
        return int(text)
    code = _BY_NAME.get(" ".join(text.split()).casefold())
    if code is None:
        raise UserError(
            f"{text!r} is not a state; expected a postal abbreviation, a name or a FARS code: VA, Virginia, 51"
        )
    return code


def state_abbreviation(code: int) -> str:
    """Return the postal abbreviation of a ``STATE`` code, or the code if it is no state's.

    >>> state_abbreviation(51)
    'VA'
    """
    return _POSTAL.get(code, str(code))
