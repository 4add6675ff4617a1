"""The reported time of day, light, weather and road condition as OpenSCENARIO's environment.

The sun is placed by the reported time and place. If the reported light contradicts that (time zones have odd borders,
and clocks are wrong), it is placed as near to that as the light allows. Unreported values are left out.
"""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from typing import Final, Literal

from trace_dag.crash.record import CrashRecord
from trace_dag.scenario.openscenario_elements import Element, element
from trace_dag.simulation.run import relative_friction

# Elevations of the sun, degrees, by LGT_COND. Civil twilight ends 6 degrees below the horizon.
_LIGHTS: Final = {1: (1.0, 90.0), 2: (-90.0, -6.0), 3: (-90.0, -6.0), 6: (-90.0, -6.0), 4: (-6.0, 6.0), 5: (-6.0, 6.0)}
_HIGHEST_LUX: Final = 100_000.0  # of the sun at the zenith (CIE clear sky)


@dataclass(frozen=True)
class Weather:
    """The weather of a scenario."""

    oktas: int
    kind: Literal["dry", "rain", "snow"] = "dry"
    rate_mm_per_h: float = 0.0
    visual_range_m: int = 100_000


# By WEATHER. Moderate rain is 2.6 to 7.6 mm an hour (AMS Glossary of Meteorology), moderate snow 1 to 2.5 mm of water;
# fog is a range of less than 1,000 m (WMO No. 407). FARS only codes that there was some.
_WEATHERS: Final = {
    0: Weather(0),
    1: Weather(0),
    2: Weather(8, "rain", 5.0, 5_000),
    3: Weather(8, "snow", 1.75, 2_000),
    4: Weather(8, "snow", 1.75, 1_000),
    5: Weather(8, visual_range_m=500),
    6: Weather(4),
    7: Weather(4, visual_range_m=500),
    10: Weather(8),
    11: Weather(8, "snow", 1.75, 500),
    12: Weather(8, "rain", 5.0, 5_000),
}


def environment(record: CrashRecord, *, carla: bool) -> Element | None:
    """Return the environment of a crash, as an action; None without time, light and weather.

    ``carla``: in the form of ScenarioRunner, with every part, intensities from 0 to 1, and no snow.

    >>> environment(record, carla=False).find(".//Environment").get("name")
    'as reported'
    """
    when, sun, weather = conditions_of(record)
    if (when is None and sun is None and weather is None) or (carla and (when is None or sun is None)):
        return None
    if carla and sun is not None:
        described: Element | None = _weather_for_carla(weather or _WEATHERS[1], *sun)
    else:
        described = _weather(weather, sun)
    return element(
        "GlobalAction",
        element(
            "EnvironmentAction",
            element(
                "Environment",
                None if when is None else element("TimeOfDay", animation=False, dateTime=when.isoformat()),
                described,
                element("RoadCondition", frictionScaleFactor=round(relative_friction(record), 3)),
                name="as reported",
            ),
        ),
    )


def conditions_of(record: CrashRecord) -> tuple[datetime.datetime | None, tuple[float, float] | None, Weather | None]:
    """Return local time, azimuth (radians clockwise from north) and elevation of the sun, and weather.

    None stands for unreported ones.
    """
    when = _when(record)
    return when, _sun(record, when), None if record.weather_code is None else _WEATHERS.get(record.weather_code)


def _weather(weather: Weather | None, sun: tuple[float, float] | None) -> Element | None:
    if weather is None and sun is None:
        return None
    shining = None
    if sun is not None:
        azimuth_rad, elevation_rad = sun
        shining = element(
            "Sun",
            azimuth=round(azimuth_rad, 4),
            illuminance=round(_HIGHEST_LUX * max(math.sin(elevation_rad), 0.0), 1),
            elevation=round(elevation_rad, 4),
        )
    if weather is None:
        return element("Weather", shining)
    return element(
        "Weather",
        shining,
        element("Fog", visualRange=weather.visual_range_m),
        element("Precipitation", precipitationType=weather.kind, precipitationIntensity=weather.rate_mm_per_h),
        fractionalCloudCover={0: "zeroOktas", 4: "fourOktas"}.get(weather.oktas, "eightOktas"),
    )


def _weather_for_carla(weather: Weather, azimuth_rad: float, elevation_rad: float) -> Element:
    rains = weather.kind == "rain"
    return element(
        "Weather",
        element(
            "Sun", azimuth=round(azimuth_rad, 4), intensity=1.0 - weather.oktas / 8, elevation=round(elevation_rad, 4)
        ),
        element("Fog", visualRange=weather.visual_range_m),
        element("Precipitation", precipitationType="rain" if rains else "dry", intensity=0.5 if rains else 0.0),
        cloudState="rainy" if rains else {0: "free", 4: "cloudy"}.get(weather.oktas, "overcast"),
    )


def _when(record: CrashRecord) -> datetime.datetime | None:
    """Return the local time of the crash; None if the hour is not reported."""
    if record.hour is None or record.month is None or record.day is None:
        return None
    return datetime.datetime(
        record.year or record.case_year, record.month, record.day, record.hour % 24, record.minute or 0
    )


def _sun(record: CrashRecord, when: datetime.datetime | None) -> tuple[float, float] | None:
    """Return the azimuth (radians clockwise from north) and elevation of the sun.

    None if neither time nor light is reported.
    """
    lowest, highest = _LIGHTS.get(record.light_code or 0, (-90.0, 90.0))
    if when is not None:
        azimuth_rad, elevation_rad = sun_position(when, record.latitude_deg, record.longitude_deg)
    elif record.light_code in _LIGHTS:
        azimuth_rad, elevation_rad = math.pi, math.radians(45.0 if record.light_code == 1 else (lowest + highest) / 2)
    else:
        return None
    return azimuth_rad, math.radians(min(max(math.degrees(elevation_rad), lowest), highest))


def sun_position(local: datetime.datetime, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return the azimuth (radians clockwise from north, 0 to 2 pi) and elevation of the sun, to about a degree.

    ``local`` is the clock time of the United States at the place: standard time of the nearest meridian of 15 degrees,
    and an hour more from the second Sunday of March to the first of November. Source: NOAA, General Solar Position
    Calculations (Spencer's series of 1971).

    >>> noon = datetime.datetime(2023, 6, 21, 13)  # an hour later by the clocks, on the meridian of their zone
    >>> round(math.degrees(sun_position(noon, 40.0, -75.0)[1]))  # 90 - 40 + 23.4
    73
    """
    zone_h = round(longitude_deg / 15) + _daylight_saving_h(local)
    hours = local.hour + local.minute / 60
    year_rad = math.tau / 365 * (local.timetuple().tm_yday - 1 + (hours - 12) / 24)
    sines, cosines = [math.sin(n * year_rad) for n in (1, 2, 3)], [math.cos(n * year_rad) for n in (1, 2, 3)]
    equation_min = 229.18 * (
        0.000075 + 0.001868 * cosines[0] - 0.032077 * sines[0] - 0.014615 * cosines[1] - 0.040849 * sines[1]
    )
    declination = (
        0.006918
        - 0.399912 * cosines[0]
        + 0.070257 * sines[0]
        - 0.006758 * cosines[1]
        + 0.000907 * sines[1]
        - 0.002697 * cosines[2]
        + 0.00148 * sines[2]
    )
    solar_min = hours * 60 + equation_min + 4 * longitude_deg - 60 * zone_h
    hour_angle = math.radians(solar_min / 4 - 180)
    latitude = math.radians(latitude_deg)
    south = math.cos(declination) * math.cos(hour_angle) * math.sin(latitude) - math.sin(declination) * math.cos(
        latitude
    )
    west = math.cos(declination) * math.sin(hour_angle)
    up = math.sin(latitude) * math.sin(declination) + math.cos(latitude) * math.cos(declination) * math.cos(hour_angle)
    return (math.atan2(west, south) + math.pi) % math.tau, math.asin(max(-1.0, min(1.0, up)))


def _daylight_saving_h(local: datetime.datetime) -> int:
    """Return 1 during daylight saving time, else 0.

    By the Energy Policy Act of 2005 it is from the second Sunday of March to the first Sunday of November, at two.
    """
    begins = _sunday(local.year, 3, 2)
    ends = _sunday(local.year, 11, 1)
    return int(begins <= local < ends)


def _sunday(year: int, month: int, number: int) -> datetime.datetime:
    first = datetime.datetime(year, month, 1, 2)
    return first + datetime.timedelta(days=(6 - first.weekday()) % 7 + 7 * (number - 1))
