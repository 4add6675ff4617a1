"""Places that a report gives in words: a crossing of two streets or a distance from it, and names of states.

The side of the road that traffic keeps follows from the state in FARS, else from the time zone of a point. No time zone
covers countries of both sides, and the zones of ``opening_hours``, made from OpenStreetMap's borders, distinguish
neighbours (Hong Kong and Shenzhen).
"""

from __future__ import annotations

import datetime
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple, TypeAlias

from trace_dag.common.errors import UserError
from trace_dag.crash.codes.elements import STATES
from trace_dag.crash.record import Octant

_ABBREVIATIONS: Final = (
    "AL AK AZ AR CA CO CT DE DC FL GA HI ID IL IN IA KS KY LA ME MD MA MI MN MS MO MT NE NV NH NJ NM NY NC ND OH OK OR "
    "PA PR RI SC SD TN TX UT VT VA VI WA WV WI WY"  # in the order of the codes
)
_POSTAL: Final = dict(zip(STATES, _ABBREVIATIONS.split(), strict=True))
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


# --- the side that traffic keeps -------------------------------------------------------------------------------------
LEFT_HAND_STATES: Final = frozenset({52})
"""FARS state codes where traffic keeps left: the US Virgin Islands."""
_LEFT_HAND_ZONES: Final = """
Africa: Blantyre Dar_es_Salaam Gaborone Harare Johannesburg Kampala Lusaka Maputo Maseru Mbabane Nairobi
Windhoek
America: Anguilla Antigua Barbados Cayman Dominica Grand_Turk Grenada Guyana Jamaica Montserrat Nassau
Paramaribo Port_of_Spain St_Kitts St_Lucia St_Thomas St_Vincent Tortola
Asia: Bangkok Brunei Colombo Dhaka Dili Famagusta Hong_Kong Jakarta Jayapura Karachi Kathmandu Kolkata
Kuala_Lumpur Kuching Macau Makassar Nicosia Pontianak Singapore Thimphu Tokyo
Atlantic: Bermuda St_Helena Stanley
Australia: Adelaide Brisbane Broken_Hill Darwin Eucla Hobart Lindeman Lord_Howe Melbourne Perth Sydney
Europe: Dublin Guernsey Isle_of_Man Jersey London Malta
Indian: Christmas Cocos Mahe Maldives Mauritius
Pacific: Apia Auckland Bougainville Chatham Fakaofo Fiji Funafuti Guadalcanal Kanton Kiritimati Nauru Niue
Norfolk Pitcairn Port_Moresby Rarotonga Tarawa Tongatapu
"""
"""Names in the tz database (``zone.tab`` of 2025b) of the countries that keep left, by area."""


def _zones() -> frozenset[str]:
    names, area = set(), ""
    for word in _LEFT_HAND_ZONES.split():
        if word.endswith(":"):
            area = word[:-1]
        else:
            names.add(f"{area}/{word}")
    return frozenset(names)


_LEFT: Final = _zones()


@lru_cache(maxsize=100_000)
def keeps_left_at(latitude_deg: float, longitude_deg: float) -> bool:
    """Return whether traffic keeps left at a point (WGS84 degrees).

    >>> keeps_left_at(51.5, -0.12), keeps_left_at(50.95, 1.86)  # London, Calais
    (True, False)
    """
    from opening_hours import OpeningHours

    always = OpeningHours("24/7", coords=(latitude_deg, longitude_deg))
    begin = next(iter(always.intervals(datetime.datetime(2022, 1, 1))))[0]
    return str(begin.tzinfo) in _LEFT
