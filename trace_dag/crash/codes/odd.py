"""Operational design domain of a crash: the terms of ISO 34503 and the tags of OpenLABEL for a report's values.

Terms are those of ISO 34503:2023, clauses 9 (scenery) and 10 (environmental conditions); tags are classes of OpenLABEL
1.0.0's ontology of scenario tags. Both follow BSI PAS 1883:2020. Some terms have no class there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from trace_dag.crash.classes import RoadTopology


class OddTerm(NamedTuple):
    """A term, and the tags that say the same."""

    term: str
    tags: tuple[str, ...] = ()


_NIGHT: Final = "illumination: night"
_TWILIGHT: Final = OddTerm("illumination: low-ambient lighting", ("LowLightAmbient",))
_SNOW: Final = OddTerm("weather: snowfall", ("WeatherSnow",))
_RAIN: Final = OddTerm("weather: rainfall", ("WeatherRain",))
_DUST: Final = OddTerm("particulates: sand and dust", ("ParticulatesDust",))
_SNOWY: Final = OddTerm("surface: snow on drivable area", ("SurfaceConditionSnow",))
_DIRTY: Final = OddTerm("surface: contamination", ("SurfaceConditionContamination",))
_MOTORWAY: Final = OddTerm("drivable area: motorway", ("RoadTypeMotorway",))
_DISTRIBUTOR: Final = OddTerm("drivable area: distributor road", ("RoadTypeDistributor",))
_SIGNAL: Final = OddTerm("signs: signalised, traffic lights")
_OTHER_JUNCTION: Final = OddTerm("junction: intersection", ("JunctionIntersection",))

ODD: Final[Mapping[str, Mapping[int | str, OddTerm]]] = {
    "LGT_COND": {
        1: OddTerm("illumination: day", ("IlluminationDay",)),
        2: OddTerm(_NIGHT, ("LowLightNight",)),
        3: OddTerm(f"{_NIGHT}, streetlights", ("LowLightNight", "ArtificialStreetLighting")),
        4: _TWILIGHT,
        5: _TWILIGHT,
        6: OddTerm(_NIGHT, ("LowLightNight",)),
    },
    "WEATHER": {
        2: _RAIN,
        3: _SNOW,  # sleet and hail, which the ontology has no class for
        4: _SNOW,
        5: OddTerm("particulates: fog", ("ParticulatesWater",)),
        6: OddTerm("weather: wind", ("WeatherWind",)),
        7: _DUST,
        10: OddTerm("illumination: cloudiness", ("IlluminationCloudiness",)),
        11: _SNOW,
        12: _RAIN,
    },
    "VSURCOND": {
        2: OddTerm("surface: wet road", ("SurfaceConditionWet",)),
        3: _SNOWY,
        4: OddTerm("surface: icy", ("SurfaceConditionIcy",)),
        5: _DIRTY,
        6: OddTerm("surface: standing water", ("SurfaceConditionStandingWater",)),
        7: _DIRTY,
        10: _SNOWY,
        11: _DIRTY,
    },
    "FUNC_SYS": {
        1: _MOTORWAY,
        2: _MOTORWAY,
        **dict.fromkeys((3, 4, 5, 6), _DISTRIBUTOR),
        7: OddTerm("drivable area: minor road", ("RoadTypeMinor",)),
    },
    "VTRAFCON": {
        **dict.fromkeys((1, 2, 3, 4, 8, 9), _SIGNAL),
        20: OddTerm("signs: stop sign"),
        21: OddTerm("signs: yield sign"),
        65: OddTerm("special structure: rail crossing"),
    },
    "TYP_INT": {
        RoadTopology.FOUR_WAY: OddTerm("junction: crossroads", ("IntersectionCrossroad",)),
        RoadTopology.T: OddTerm("junction: T-junction", ("IntersectionTJunction",)),
        RoadTopology.Y: OddTerm("junction: Y-junction", ("IntersectionYJunction",)),
        RoadTopology.ROUNDABOUT: OddTerm("junction: roundabout", ("JunctionRoundabout",)),
        RoadTopology.FIVE_POINT_OR_MORE: _OTHER_JUNCTION,
        RoadTopology.L: _OTHER_JUNCTION,
    },
}
"""Terms by element and code; of ``TYP_INT`` by the coverage class, which is also implied by other elements."""


def odd_terms(said: Iterable[tuple[str, int | str | None]]) -> Iterator[OddTerm]:
    """Yield the terms of elements with their codes.

    >>> [each.term for each in odd_terms([("LGT_COND", 2), ("WEATHER", 1), ("VSURCOND", None)])]
    ['illumination: night']
    """
    for element, code in said:
        if code is not None and (term := ODD[element].get(code)):
            yield term
