"""What is judged of a handed-in run again: its drive."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tests.agents.cases import crossing, drive, rear_end
from trace_dag.agents.evaluation.agents import Motion
from trace_dag.agents.evaluation.baselines import BrakeOnTimeToCollision, CautiousLaneKeeper, IdmLaneKeeper, Replay
from trace_dag.agents.evaluation.rejudging import RATE_HZ, problem_of_drive
from trace_dag.agents.evaluation.traffic import Traffic


class Creeps:
    """Drives at 1 m/s."""

    def reset(self, scenario):
        pass

    def act(self, observation):
        return Motion(target_speed_mps=1.0)


@pytest.mark.parametrize("of", [rear_end, crossing])
@pytest.mark.parametrize("agent", [Replay, BrakeOnTimeToCollision, IdmLaneKeeper, CautiousLaneKeeper, Creeps])
def test_the_reported_drive_is_the_driven_one(of, agent):
    found = drive(of(), agent(), 1)
    assert problem_of_drive(of(), 1, found.metrics, Traffic.RECORDED, found.drive) == ""
    places = json.loads(found.drive)
    assert sorted(places) == ["1", "2"]
    ended_s = found.metrics.contact_time_s
    assert ended_s is None or len(places["1"]) == int(ended_s * RATE_HZ) + 1


def test_drives_that_were_not_driven_are_found():
    crash = crossing()
    avoided = drive(crash, CautiousLaneKeeper(), 1)
    replayed, crept = drive(crash, Replay(), 1), drive(crash, Creeps(), 1)

    def problem(metrics, told):
        return problem_of_drive(crash, 1, metrics, Traffic.RECORDED, told)

    assert "collided is True, but nobody is nearer" in problem(replayed.metrics, crept.drive)
    assert problem(avoided.metrics, crept.drive) == "arrived is True, of its drive False"
    assert problem(avoided.metrics, "") == "its drive is not the places of everybody in the crash"
    places = json.loads(avoided.drive)
    elsewhere = {**places, "2": [[x + 50.0, *rest] for x, *rest in places["2"]]}
    assert problem(avoided.metrics, json.dumps(elsewhere)) == "body 2 does not begin where the crash has it"
    jumps = {**places, "1": [places["1"][0], *([x + 30.0, *rest] for x, *rest in places["1"][1:])]}
    assert "velocity changes by" in problem(avoided.metrics, json.dumps(jumps))
    off_road = replace(avoided.metrics, off_road_s=3.0)
    assert problem(off_road, avoided.drive).startswith("off_road_s is 3.0, of its drive 0")
    onward = {name: [*each, *[each[-1]] * 4] for name, each in json.loads(replayed.drive).items()}
    through = {**onward, "1": [*onward["1"][:-4], *[onward["2"][-1]] * 4]}
    assert problem(replace(replayed.metrics, collided=False), json.dumps(through)) != ""
