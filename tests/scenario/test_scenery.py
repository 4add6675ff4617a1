"""What is behind the roads is drawn where it is and below them; night darkens the map; its edge fades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from tests.roads.towns import FRAME, Town
from tests.scenario.pixels import drawn as as_pixels
from tests.scenario.pixels import rgb
from tests.verdict.crashes import record, vehicle
from trace_dag.crash.summary import conditions_in_words, is_dark
from trace_dag.osm.types import OsmFeature
from trace_dag.pages.canvas import Canvas
from trace_dag.pages.map_ground import ASPHALT
from trace_dag.pages.maps import GROUND, MapDrawing

BUILDING = "#D2C5B4"


def feature(*corners_m: tuple[float, float], **tags: str) -> OsmFeature:
    places = FRAME.to_geographic(np.array(corners_m, float))[:, ::-1]
    return OsmFeature("way/1", shapely.Polygon(places), tags)


def drawn(half_m: float, *features: OsmFeature, dark: bool = False) -> np.ndarray:
    """A street from west to east, 300 m each way, in a square window; rows from north to south, a pixel each metre."""
    town = Town()
    town.street([(-300, 0), (300, 0)], name="Main Street")
    window = (-half_m, -half_m, half_m, half_m)
    canvas = Canvas(window, 1.5 * half_m)
    MapDrawing(town.network(), window, surroundings=features, dark=dark, fading=True).draw(canvas, names=False)
    return np.asarray(as_pixels(canvas.svg(), int(2 * half_m))) / 255


def colour_at(pixels: np.ndarray, x_m: float, y_m: float) -> np.ndarray:
    half = len(pixels) // 2
    return pixels[half - round(y_m), half + round(x_m)]


def test_a_building_is_drawn_where_it_is_and_the_road_over_it() -> None:
    house = feature((20, -20), (40, -20), (40, 20), (20, 20), building="yes")
    pixels = drawn(60, house)
    assert colour_at(pixels, 30, 12) == pytest.approx(rgb(BUILDING), abs=0.02)
    assert colour_at(pixels, 30, 2) == pytest.approx(rgb(ASPHALT), abs=0.02)
    assert colour_at(pixels, 50, 12) == pytest.approx(rgb(GROUND), abs=0.02)


def test_the_road_fades_where_the_map_ends() -> None:
    pixels = drawn(320)
    contrast = [np.abs(colour_at(pixels, x, 2) - rgb(GROUND)).max() for x in (200, 280, 297)]
    assert contrast[0] == pytest.approx(np.abs(rgb(ASPHALT) - rgb(GROUND)).max(), abs=0.03)
    assert contrast[0] > contrast[1] > contrast[2]
    assert contrast[2] < 0.05


def test_night_and_weather_are_as_reported() -> None:
    day, night = drawn(60), drawn(60, dark=True)
    assert colour_at(night, 30, 30).mean() < 0.85 * colour_at(day, 30, 30).mean()
    at_night = replace(record(vehicle(1, 12, 50), vehicle(2, 12, 51)), light_code=3, weather_code=2)
    assert is_dark(at_night)
    assert "rain" in conditions_in_words(at_night)
    assert not is_dark(replace(at_night, light_code=1))
    assert conditions_in_words(replace(at_night, light_code=9, weather_code=99)) == ""
