"""The side of the road that traffic keeps: by state in FARS, else by the time zone of a point.

No time zone covers countries of both sides, and the zones of ``opening_hours``, made from OpenStreetMap's borders,
distinguish neighbours (Hong Kong and Shenzhen).
"""

from __future__ import annotations

import datetime
from functools import lru_cache
from typing import Final

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
