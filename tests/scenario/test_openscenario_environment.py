"""Time, light and weather of a scenario are those of the report, and the sun stands where almanacs have it."""

from __future__ import annotations

import datetime
import math
from dataclasses import replace

import pytest
from lxml import etree

from tests.simulation.motions import participant, straight
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.common.settings import SimSettings
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.scenario.openscenario_environment import sun_position
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.surface import NetworkSurface

RECORD = replace(
    record(vehicle(1, 12), vehicle(2, 6)), year=2023, month=6, day=14, hour=21, minute=45, light_code=2, weather_code=2
)


@pytest.fixture(scope="module")
def log():
    settings = SimSettings()
    simulation = EmbeddedSimulation(settings, NetworkSurface(STREET), settings.friction)
    drivers = participant(1, straight(-60.0, 0.0, 0.0, 20.0)), participant(2, straight(0.0, 0.0, 0.0, 5.0))
    return simulation.run(drivers, time_limit_s=10.0)


def environment_of(crash, log, flavour=None):
    written = etree.fromstring(OpenScenarios(crash, STREET, log).write(flavour))
    return written.find("Storyboard/Init/Actions/GlobalAction/EnvironmentAction/Environment")


# Washington, D.C. Noon heights are 90 - latitude + declination; sunrise at an equinox is due east on the horizon (the
# disc's upper edge 50' higher). Times of noon, sunrise and sunset: U.S. Naval Observatory.
@pytest.mark.parametrize(
    ("local", "azimuth_deg", "elevation_deg"),
    [
        (datetime.datetime(2023, 6, 21, 13, 10), 180.0, 90 - 38.9 + 23.44),
        (datetime.datetime(2023, 12, 21, 12, 6), 180.0, 90 - 38.9 - 23.44),
        (datetime.datetime(2023, 3, 20, 7, 12), 90.0, -0.83),
        (datetime.datetime(2023, 12, 21, 16, 50), 240.3, -0.83),
    ],
)
def test_the_sun_is_where_almanacs_have_it(local, azimuth_deg, elevation_deg):
    azimuth_rad, elevation_rad = sun_position(local, 38.9, -77.04)
    assert math.degrees(azimuth_rad) == pytest.approx(azimuth_deg, abs=1.0)
    assert math.degrees(elevation_rad) == pytest.approx(elevation_deg, abs=0.5)


def test_a_rainy_night_is_one(log):
    wet = replace(RECORD, vehicles=tuple(replace(each, surface_condition_code=2) for each in RECORD.vehicles))
    found = environment_of(wet, log)
    assert found.find("TimeOfDay").get("dateTime") == "2023-06-14T21:45:00"
    assert found.find("Weather").get("fractionalCloudCover") == "eightOktas"
    assert found.find("Weather/Precipitation").get("precipitationType") == "rain"
    assert float(found.find("Weather/Sun").get("illuminance")) == 0
    assert float(found.find("Weather/Sun").get("elevation")) <= math.radians(-6) + 1e-4
    assert float(found.find("RoadCondition").get("frictionScaleFactor")) == 0.75


def test_the_reported_light_wins_over_the_clock(log):
    found = environment_of(replace(RECORD, light_code=1, weather_code=1), log)
    assert float(found.find("Weather/Sun").get("elevation")) > 0


def test_scenario_runner_finds_every_part_and_no_snow(log):
    # What openscenario_parser.py asks for without a default, and refuses
    found = environment_of(replace(RECORD, weather_code=4), log, Flavour(carla=True))
    assert found.find("Weather").get("cloudState") == "overcast"
    assert 0 <= float(found.find("Weather/Sun").get("intensity")) <= 1
    assert found.find("Weather/Precipitation").get("precipitationType") == "dry"
    assert found.find("Weather/Fog") is not None
    assert found.find("TimeOfDay") is not None


def test_unreported_facts_are_left_out(log):
    silent = replace(RECORD, hour=None, light_code=None, weather_code=None)
    assert environment_of(silent, log) is None
    assert environment_of(silent, log, Flavour(carla=True)) is None
    only_light = environment_of(replace(silent, light_code=3), log)
    assert only_light.find("TimeOfDay") is None
    assert float(only_light.find("Weather/Sun").get("elevation")) < 0
