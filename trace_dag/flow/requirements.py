"""What the settings ask of this machine and of services, looked at before a run, before anything is replaced.

Each raises :class:`trace_dag.errors.UserError`.
"""

from __future__ import annotations

from trace_dag.cohorts.services import Services
from trace_dag.errors import Failure, UserError
from trace_dag.roads.build import road_converter
from trace_dag.settings import Settings
from trace_dag.sim.backends import backend_factory


def road_map(settings: Settings, services: Services) -> None:
    """The converter the settings name has to be installed."""
    road_converter(settings.roads).require()


def state_estimate(settings: Settings, services: Services) -> None:
    """The language model the settings name has to answer: prompt, key, model, budget and the way to it are right."""
    if settings.states.estimator != "llm":
        return
    from trace_dag.states.llm.prompt import Prompt

    Prompt.load(settings.states.llm_prompt)
    try:
        services.language_model(settings.states).try_out()
    except Failure as failure:
        raise UserError(f"the language model cannot be asked, so nothing is run: {failure}") from failure


def simulation_log(settings: Settings, services: Services) -> None:
    """The simulator the settings name has to be there."""
    backend_factory(settings.sim).require(settings.sim)
