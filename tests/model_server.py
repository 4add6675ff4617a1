"""What a language model's provider says, for a loopback server: OpenAI's protocol, and answers about known crashes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable

from cases import SETTINGS, Case
from loopback import Answer, Request

from lab.narratives import StandIn
from trace_dag.common.settings import StateSettings
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.language.choices import Choices
from trace_dag.reconstruction.analytic_hypotheses import build_scene, parties, solve_all
from trace_dag.reconstruction.candidates import candidates
from trace_dag.reconstruction.pre_crash_scenarios import pre_crash_scenarios

KEY = "sk-test-4f9a8b7c6d5e4f3a2b1c"
MODEL = "openai/gpt-4o"
PROMPT_TOKENS, COMPLETION_TOKENS = 1200, 80
COST_USD = PROMPT_TOKENS * 2.5e-6 + COMPLETION_TOKENS * 10e-6  # of one answer, by OpenAI's list price of gpt-4o

Respond = Callable[[Request, int], Answer]


def llm_settings(**changes: object) -> StateSettings:
    """Settings of the LLM estimator that ask the loopback server as fast as it goes."""
    given = {
        "estimator": "llm",
        "llm_model": MODEL,
        "llm_timeout_s": 20.0,
        "llm_requests_per_minute": 1e6,
        **changes,
    }
    return SETTINGS.states.model_copy(update=given)


def choices_of(case: Case) -> Choices:
    """What the model can choose from."""
    scene = build_scene(case.record, case.network, case.report, lead_time_s=5.0)
    readings = pre_crash_scenarios(case.record, *parties(case.record, sequence_of(case.record).first))
    return Choices(scene, tuple(each for reading in readings for each in candidates(scene, reading)))


def right_answer(case: Case) -> dict:
    """What a model that understands the crash answers: the approaches of the analytic estimator's best."""
    choices = choices_of(case)
    best = solve_all(choices.scene, list(choices.found))[0]
    vehicles = []
    for party, placed in (
        (best.candidate.scenario.mover, best.mover),
        (best.candidate.scenario.other, best.other),
    ):
        approach = next(each for each in choices.offered if each.approach.name == placed.option.approach.name)
        position = min((party.vehicle.travel_speed_mps or 10.0) * 5, approach.length_m)
        vehicles.append(
            {
                "vehicle_number": party.vehicle.number,
                "candidate": approach.id,
                "position_m": position,
                "heading_deg": approach.heading_deg(position),
            }
        )
    x_m, y_m = choices.scene.place_xy_m
    return {"reasoning": "as reported", "vehicles": vehicles, "crash": {"x_m": x_m, "y_m": y_m}}


def altered(answer: dict, **changes: object) -> dict:
    """The answer with its first vehicle changed."""
    first, *rest = answer["vehicles"]
    return {**answer, "vehicles": [{**first, **changes}, *rest]}


def completion(content: str | dict | None, *, finish: str = "stop", refusal: str | None = None) -> Answer:
    """A chat completion with this content."""
    text = content if isinstance(content, str) or content is None else json.dumps(content)
    message = {"role": "assistant", "content": text} | ({"refusal": refusal} if refusal else {})
    body = {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 1,
        "model": "gpt-4o",
        "choices": [{"index": 0, "message": message, "finish_reason": finish}],
        "usage": {
            "prompt_tokens": PROMPT_TOKENS,
            "completion_tokens": COMPLETION_TOKENS,
            "total_tokens": PROMPT_TOKENS + COMPLETION_TOKENS,
        },
    }
    return Answer(json.dumps(body).encode(), headers={"Content-Type": "application/json"})


READY = completion({"ready": True})
"""What answers the question before a run."""


def failing(status: int, **headers: str) -> Answer:
    """An error of the provider's, one that quotes the key it was called with."""
    body = json.dumps({"error": {"message": f"sorry, {KEY} cannot be served", "type": "error", "code": str(status)}})
    return Answer(body.encode(), status=status, headers={"Content-Type": "application/json", **headers})


def in_turn(*answers: Answer) -> Respond:
    """One answer after the other, the last one again and again."""
    return lambda _, before: answers[min(before, len(answers) - 1)]


def knowing(crashes: Iterable[Case]) -> Respond:
    """A model that answers rightly for each of some crashes."""
    answers = {case.key: right_answer(case) for case in crashes}
    return lambda request, _: completion(answers[asked_about(request)])


def narrating() -> Respond:
    """A model that reads the narratives of the sample as their answers written by hand say."""
    stand_in = StandIn()

    def respond(request: Request, _: int) -> Answer:
        asked = json.loads(request.body)["messages"]
        return completion(stand_in.answer(asked)) if "<narrative>" in request.body.decode() else READY

    return respond


def is_trial(request: Request) -> bool:
    """Whether a request is about no crash: the question before a run, whether anybody is there."""
    return "<data>" not in request.body.decode()


def asked_about(request: Request) -> str:
    """The key of the crash a request is about."""
    question = json.loads(request.body)["messages"][1]["content"]
    data = question[question.index("<data>") + len("<data>") : question.index("</data>")]
    return str(json.loads(data)["report"]["summary"]).removeprefix("Crash ").partition(":")[0]


def as_coordinates(case: Case, answer: dict) -> dict:
    """The same answer to the question for coordinates."""
    choices = choices_of(case)
    vehicles = []
    for vehicle in answer["vehicles"]:
        approach = next(each for each in choices.offered if each.id == vehicle["candidate"])
        pose = approach.approach.path.pose(approach.approach.station_m - vehicle["position_m"])
        vehicles.append(
            {
                "vehicle_number": vehicle["vehicle_number"],
                "x_m": pose.x_m,
                "y_m": pose.y_m,
                "heading_deg": vehicle["heading_deg"],
            }
        )
    return {**answer, "vehicles": vehicles}
