"""Packages in players as people start them: the crash happens when and where the log has it, whoever plays it."""

from __future__ import annotations

import json
import math
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests import sample_runs
from tests.scenario import esmini
from tests.scenario.player import Collision, Scenario
from tests.simulation.motions import log_of, meeting
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.common.settings import SimSettings
from trace_dag.crash.parties import party_label
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.simulation.types import SimulationLog

WHEN_S, WHERE_M = 0.02, 0.1
EXACT_M, EXACT_RAD = 0.005, 0.002
STEPS_S = (0.001, 0.01, 0.02)
MEETINGS = {
    "into one that stands": (0.0, 15.0, 0.0, 0.3),
    "into one that creeps": (0.0, 12.0, 1.0, 0.0),
    "standing one from the side": (math.pi / 2, 18.0, 0.0, 1.5),
    "both slow, crossing": (math.pi / 2, 4.0, 3.0, 0.0),
    "crossing": (math.pi / 2, 14.0, 11.0, 1.0),
    "head-on": (math.pi, 20.0, 18.0, 0.4),
    "a slow one pushed back": (math.pi, 16.0, 1.5, 0.2),
    "offset, both spin": (2.6, 17.0, 6.0, 1.6),
    "turning across": (-2.2, 22.0, 5.0, 0.8),
}


@cache
def simulated(name: str) -> SimulationLog:
    log = log_of(meeting(*MEETINGS[name]), SimSettings(time_limit_s=12.0))
    assert log.first_contact is not None
    return log


@cache
def written(name: str, flavour: Flavour) -> bytes:
    return OpenScenarios(record(vehicle(1, 12), vehicle(2, 9)), STREET, simulated(name)).write(flavour)


def late_s(log: SimulationLog, collision: Collision | None) -> float:
    return math.inf if collision is None else abs(collision.time_s - log.first_contact.time_s)


def away_m(log: SimulationLog, scenario: Scenario, time_s: float) -> float:
    """The farther of the bodies from where the log has it."""
    away = []
    for logged in log.vehicles:
        x, y, _ = scenario.centres(party_label(logged.number), np.array([time_s]))[0]
        there = (np.interp(time_s, logged.time_s, values) for values in (logged.x_m, logged.y_m))
        away.append(math.dist((x, y), tuple(there)))
    return max(away)


@pytest.mark.parametrize("flavour", [Flavour(), Flavour(carla=True)], ids=["1.2", "carla"])
@pytest.mark.parametrize("name", MEETINGS)
@pytest.mark.parametrize("player", [Scenario, esmini.FilteredScenario], ids=["to the letter", "filtering"])
def test_a_crash_is_seen_when_and_where_it_was(player: type[Scenario], name: str, flavour: Flavour) -> None:
    log, scenario = simulated(name), player(written(name, flavour))
    for step_s in STEPS_S:
        collision = scenario.play(step_s)
        assert late_s(log, collision) <= WHEN_S + 1e-9, f"in steps of {step_s} s"
        assert away_m(log, scenario, collision.time_s) <= WHERE_M


@pytest.mark.parametrize("name", MEETINGS)
def test_crashes_left_out_by_filters_are_not_missed_by_others(name: str) -> None:
    log, scenario = simulated(name), Scenario(written(name, Flavour()))
    for logged in log.vehicles:
        x, y, heading = scenario.centres(party_label(logged.number), logged.time_s).T
        assert np.hypot(x - logged.x_m, y - logged.y_m).max() < EXACT_M
        assert np.abs(np.angle(np.exp(1j * (heading - logged.heading_rad)))).max() < EXACT_RAD


def test_an_even_way_has_no_vertices_but_those_that_players_need() -> None:
    log, scenario = simulated("head-on"), Scenario(written("head-on", Flavour()))
    times = scenario.vertices["V1"][:, 0]
    before = times < log.first_contact.time_s - 1e-5
    assert before.sum() <= 3  # the start, where players are, and what keeps the touch for those that merge vertices
    assert (log.vehicles[0].time_s < log.first_contact.time_s).sum() > 20


@pytest.mark.parametrize("name", MEETINGS)
def test_a_player_goes_no_frame_beyond_the_end(name: str) -> None:
    """Beyond the last vertex a vehicle is nobody's: esmini drives it on along its lane."""
    log = simulated(name)
    for flavour in (Flavour(), Flavour(carla=True)):
        condition = Scenario(written(name, flavour)).root.find("Storyboard/StopTrigger//SimulationTimeCondition")
        assert condition.get("rule") == "greaterThan"
        assert 0 < log.duration_s - float(condition.get("value")) < 0.001  # however its steps add up


@pytest.mark.parametrize("flavour", [Flavour(), Flavour(carla=True)], ids=["1.2", "carla"])
@pytest.mark.parametrize("name", ["into one that stands", "offset, both spin"])
def test_the_filtering_player_is_what_esmini_does(name: str, flavour: Flavour, tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_bytes(write_opendrive(STREET))
    file = tmp_path / "scenario.xosc"
    file.write_bytes(written(name, flavour))
    filtering = esmini.FilteredScenario(file.read_bytes())
    collision, places, errors = esmini.play(file, 0.0073, tmp_path)  # no step falls on a vertex
    assert errors == []
    assert collision is not None
    assert collision.time_s == pytest.approx(filtering.play(0.0073).time_s, abs=1e-6)
    for entity, rows in places.items():
        # One that starts after 0 s, as revision 1.0 has it, is where it is put for one step more.
        rows = rows[(rows[:, 0] > 0.01) & (rows[:, 0] < filtering.vertices[entity][-1, 0])]
        expected = filtering.reference(entity, rows[:, 0])
        assert np.hypot(*(rows[:, 1:3] - expected[:, :2]).T).max() < 1e-3
        assert np.abs(np.angle(np.exp(1j * (rows[:, 3] - expected[:, 3])))).max() < 1e-3


def test_packages_of_the_sample_collide_in_esmini(tmp_path: Path) -> None:
    esmini.program()
    packages = sorted((sample_runs.finished() / "benchmark" / "packages").glob("*.zip"))
    assert packages
    for package in packages:
        with zipfile.ZipFile(package) as archive:
            archive.extractall(tmp_path)
        folder = tmp_path / package.stem
        contact = json.loads((folder / "trajectories.json").read_text())["contacts"][0]
        for scenario in ("scenario.xosc", "scenario.carla.xosc"):
            collision, _, errors = esmini.play(folder / scenario, 0.01, tmp_path)
            assert errors == [], package.name
            assert collision is not None, f"{package.name}, {scenario}"
            assert collision.time_s == pytest.approx(contact["time_s"], abs=WHEN_S)
