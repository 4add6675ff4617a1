"""Hidden parts of reports: what is left of them, and what estimators make of it."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from cases import SAMPLE, Case, sample_case
from loopback import Loopback, Request, serving
from model_server import KEY, MODEL, READY, as_coordinates, completion, is_trial, right_answer
from sample_runs import reports_of

from lab.masked_reports import by_estimator, came_in_same_lane, lane_rows, movement_rows, recovered
from lab.masking import collisions, without_area, without_lanes, without_movement, without_types
from trace_dag.common.stage import Stage
from trace_dag.crash.record import PreCrashMovement
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace
from trace_dag.simulation.states import ParticipantState

LEFT_TURN = "2023-319003"
COORDINATES = f"llm:coordinates-v1@{MODEL}"


@pytest.fixture(scope="module")
def case() -> Case:
    return sample_case(LEFT_TURN)


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A root with one judged crash."""
    folder = tmp_path_factory.mktemp("masked")
    workspace = Workspace.open(str(folder / "root"), FLOW)
    ingest(workspace.storage, "sample", reports=[reports_of(folder / "reports", [LEFT_TURN])], maps=[SAMPLE / "osm"])
    list(run_stages(workspace, [LEFT_TURN], tuple(Stage), run_id="masked"))
    return workspace.root


@pytest.fixture
def root(judged: str, tmp_path: Path) -> str:
    """One of its own: answers are stored, and never asked for twice."""
    return str(shutil.copytree(judged, tmp_path / "root"))


@pytest.fixture
def model(case: Case, monkeypatch: pytest.MonkeyPatch) -> Iterator[Loopback]:
    """A model that knows where both vehicles came from, and answers in coordinates over HTTP."""
    answer = completion(as_coordinates(case, right_answer(case)))

    def respond(request: Request, _: int):
        return READY if is_trial(request) else answer

    with serving(respond) as server:
        monkeypatch.setenv("OPENAI_API_KEY", KEY)
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        monkeypatch.setenv("TRACE_DAG_STATES__LLM_REQUESTS_PER_MINUTE", "1000000")
        yield server


def test_a_masked_fact_is_nowhere_in_the_record(case: Case) -> None:
    first = case.record.vehicles[0]
    assert first.impact is not None
    hidden = without_area(case.record, first.number)
    assert hidden.vehicles[0].impact is None
    assert {e.area_1 if e.party_1 == first.number else e.area_2 for e in hidden.events} == {None}
    assert hidden.vehicles[1] == case.record.vehicles[1]
    assert without_movement(case.record, first.number).vehicles[0].movement is PreCrashMovement.UNKNOWN
    assert {each.crash_type_code for each in without_types(case.record).vehicles} == {None}
    nothing_of_lanes = {
        (each.lanes, each.location_code, each.critical_event_code, each.crash_type_code, each.impact, each.movement)
        for each in without_lanes(case.record).vehicles
    }
    assert nothing_of_lanes == {(None, None, None, None, None, PreCrashMovement.UNKNOWN)}


def test_a_report_that_states_it_twice_gives_it_back(root: str) -> None:
    """A car turns left across a motorcycle: its crash type says so when its movement is hidden."""
    rows = list(movement_rows(list(collisions(root, 4, "analytic")), with_types=False))
    assert rows == [("left", "left"), ("along", "along")]


def test_a_language_model_is_asked_about_the_same_hidden_things_and_has_a_column(root: str, model: Loopback) -> None:
    figures = list(recovered(by_estimator(root, 2, [COORDINATES])))
    questions = [json.loads(each.body)["messages"] for each in model.requests if not is_trial(each)]
    asked = [messages[1]["content"] for messages in questions if len(messages) == 2]
    again = [messages[3]["content"] for messages in questions if len(messages) > 2]
    assert all("impact area" in each for each in again)  # with its turn hidden, cars of other sides fit the areas
    assert len(asked) == sum(figure.hidden for figure in figures if "interval" not in figure.name) - 1  # lanes: at once
    assert {tuple(figure.asked) for figure in figures} == {(COORDINATES,)}
    lanes = next(figure for figure in figures if figure.name.startswith("lanes"))
    assert lanes.asked[COORDINATES] == 100.0  # it knows them
    said = [json.loads(text[text.index("<data>") + 6 : text.index("</data>")])["report"] for text in asked]
    assert len({json.dumps(each) for each in said}) == len(said)  # each hides something else


def test_fields_that_a_model_cannot_answer_are_not_recovered(root: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(lambda request, _: READY if is_trial(request) else completion("I do not know.")) as server:
        monkeypatch.setenv("OPENAI_API_KEY", KEY)
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        monkeypatch.setenv("TRACE_DAG_STATES__LLM_REQUESTS_PER_MINUTE", "1000000")
        rows = list(lane_rows(list(collisions(root, 2, COORDINATES))))
    assert [same for same, _ in rows] == [False, False]


def test_motions_of_one_lane_differ_from_those_beside_it(root: str) -> None:
    (crash,) = collisions(root, 0, "analytic")
    assert crash.whole is not None
    party = crash.whole[0].best.participants[0]
    path, place = party.trajectory, party.initial_pose
    assert came_in_same_lane(party, party, 3.5)

    def moved(ahead_m: float, left_m: float) -> ParticipantState:
        x_m, y_m = place.to_world((ahead_m, left_m)) - place.xy_m
        began = replace(place, x_m=place.x_m + x_m, y_m=place.y_m + y_m)
        return replace(party, initial_pose=began, trajectory=replace(path, x_m=path.x_m + x_m, y_m=path.y_m + y_m))

    assert came_in_same_lane(party, moved(4.0, 0.0), 3.5)
    assert not came_in_same_lane(party, moved(0.0, 4.0), 3.5)
    backwards = replace(party, initial_pose=replace(place, heading_rad=place.heading_rad + math.pi))
    assert not came_in_same_lane(party, backwards, 3.5)
