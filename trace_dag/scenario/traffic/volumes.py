"""Vehicles an hour and lane by class of road, area, day and hour, and the mix of vehicles, from published averages.

Daily traffic per lane is vehicle-miles per lane-mile of 1998 (Bureau of Transportation Statistics, National
Transportation Statistics 2000, table 1-30M, from FHWA's Highway Statistics). Shares of a day's hours and of a week's
days are the national ones of EPA's MOVES (Population and Activity of On-road Vehicles in MOVES2014, EPA-420-R-16-003a),
which come from FHWA's permanent counters. The mix of vehicles is that of vehicle-miles in 2010 (FHWA, Highway
Statistics 2010, table VM-1). All are means over the country; for one road on one day they only give the order of
magnitude.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from enum import StrEnum
from typing import Final, NamedTuple

from trace_dag.crash.record import CrashRecord, VehicleClass
from trace_dag.osm.road_classes import road_class

MOST_PER_HOUR: Final = 2000.0
"""Capacity of a lane: the Highway Capacity Manual's of multi-lane highways, passenger cars an hour."""

_RURAL: Final = 1  # RUR_URB
_DAYS_OF_A_YEAR: Final = 365.0


class TrafficClass(StrEnum):
    """Classes of roads in the tables, with OpenStreetMap's below each."""

    INTERSTATE = "interstate"  # motorway
    ARTERIAL = "arterial"  # trunk, primary, secondary, ramps of motorways
    COLLECTOR = "collector"  # tertiary, unclassified
    LOCAL = "local"  # residential, living street


_BY_RANK: Final = {0: TrafficClass.INTERSTATE} | {
    rank: each
    for each, ranks in (
        (TrafficClass.ARTERIAL, (1, 2, 3)),
        (TrafficClass.COLLECTOR, (4, 5)),
        (TrafficClass.LOCAL, (6,)),
    )
    for rank in ranks
}

_YEARLY_PER_LANE: Final[Mapping[bool, Mapping[TrafficClass, float]]] = {  # by whether the area is rural
    False: dict(zip(TrafficClass, (5_140e3, 1_899e3, 698e3, 191e3), strict=True)),
    True: dict(zip(TrafficClass, (1_885e3, 750e3, 182e3, 29e3), strict=True)),
}
_WEEKEND_OF_WEEK: Final = {False: 0.237635, True: 0.27882}  # two days of seven, by whether the area is rural

_HOURLY_PERCENT: Final[Mapping[tuple[bool, bool], tuple[float, ...]]] = {  # by rural area, and by weekend
    (False, False): (
        *(0.986, 0.627, 0.506, 0.467, 0.699, 1.849, 4.596, 6.964, 6.083, 5.029, 4.994, 5.437),
        *(5.765, 5.803, 6.226, 7.100, 7.697, 7.743, 5.978, 4.439, 3.545, 3.182, 2.494, 1.791),
    ),
    (False, True): (
        *(2.147, 1.444, 1.097, 0.749, 0.684, 1.036, 1.843, 2.681, 3.639, 4.754, 5.747, 6.508),
        *(7.132, 7.149, 7.172, 7.201, 7.115, 6.789, 6.177, 5.169, 4.287, 3.803, 3.221, 2.457),
    ),
    (True, False): (
        *(1.077, 0.764, 0.655, 0.663, 0.954, 2.006, 4.103, 5.797, 5.347, 5.255, 5.506, 5.767),
        *(5.914, 6.080, 6.530, 7.261, 7.738, 7.548, 5.871, 4.399, 3.573, 3.074, 2.385, 1.732),
    ),
    (True, True): (
        *(1.642, 1.119, 0.854, 0.679, 0.722, 1.076, 1.768, 2.688, 3.866, 5.224, 6.317, 6.994),
        *(7.293, 7.312, 7.362, 7.446, 7.422, 7.001, 6.140, 5.050, 4.121, 3.364, 2.622, 1.917),
    ),
}

_MIX: Final[Mapping[tuple[bool, bool], tuple[float, ...]]] = {  # by rural area, and interstate; 10^6 vehicle-miles
    (True, True): (138_324, 43_965, 1_524, 1_553, 11_217, 49_104),
    (True, False): (229_775 + 230_210, 89_585 + 92_755, 2_890 + 2_806, 2_034 + 2_048, 18_934 + 18_058, 33_064 + 16_218),
    (False, True): (339_570, 83_723, 2_223, 2_011, 14_498, 35_807),
    (False, False): (1_087_865, 312_684, 9_070, 6_123, 48_031, 41_595),
}
MIXED: Final = (
    VehicleClass.CAR,  # light duty, short wheelbase
    VehicleClass.PICKUP,  # light duty, long wheelbase
    VehicleClass.MOTORCYCLE,
    VehicleClass.BUS,
    VehicleClass.TRUCK,  # single-unit
    VehicleClass.TRACTOR_TRAILER,  # combination
)


class Hour(NamedTuple):
    """An hour of a day in an area."""

    rural: bool
    weekend: bool
    hour: int


def hour_of(record: CrashRecord) -> Hour:
    """Return the hour of a crash; unreported parts default to an urban area, a weekday, and noon.

    >>> hour_of(record)
    Hour(rural=False, weekend=True, hour=21)
    """
    known = record.year and record.month and record.day
    weekend = bool(known) and date(record.year or 1, record.month or 1, record.day or 1).weekday() >= 5
    return Hour(record.rural_urban_code == _RURAL, weekend, 12 if record.hour is None else record.hour % 24)


def traffic_class(highway: str) -> TrafficClass | None:
    """Return the class of an OpenStreetMap road; None for a road that is not public, which the tables omit.

    A motorway's ramps, which are also omitted, carry the volume of the arterials to which they lead.

    >>> traffic_class("motorway_link").value, traffic_class("service")
    ('arterial', None)
    """
    return TrafficClass.ARTERIAL if highway == "motorway_link" else _BY_RANK.get(road_class(highway).rank)


def hourly_volume(of: TrafficClass, at: Hour) -> float:
    """Return the vehicles an hour of one lane.

    Example: urban arterials carry 1,899,000 vehicles a year and lane, which is 5,203 a day. On weekdays it is 0.762365
    * 7 / 5 times that, and 7.743 % of it from 17 to 18 o'clock.

    >>> round(hourly_volume(TrafficClass.ARTERIAL, Hour(rural=False, weekend=False, hour=17)))
    430
    """
    weekend = _WEEKEND_OF_WEEK[at.rural]
    of_day = weekend * 7 / 2 if at.weekend else (1 - weekend) * 7 / 5
    share = _HOURLY_PERCENT[at.rural, at.weekend][at.hour] / 100
    return _YEARLY_PER_LANE[at.rural][of] / _DAYS_OF_A_YEAR * of_day * share


def vehicle_mix(of: TrafficClass, at: Hour) -> dict[VehicleClass, float]:
    """Return the share of each class among the vehicles of a road.

    >>> round(vehicle_mix(TrafficClass.LOCAL, Hour(rural=False, weekend=False, hour=8))[VehicleClass.BUS], 4)
    0.0041
    """
    miles = _MIX[at.rural, of is TrafficClass.INTERSTATE]
    return {each: part / sum(miles) for each, part in zip(MIXED, miles, strict=True)}
