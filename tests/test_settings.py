"""Settings from the root's file, the environment and the caller."""

from __future__ import annotations

import pytest

from trace_dag.errors import UserError
from trace_dag.settings import Settings, load_settings


def test_defaults_need_nothing():
    assert load_settings() == Settings()


def test_environment_wins_over_the_file_and_the_caller_over_both(monkeypatch):
    monkeypatch.setenv("TRACE_DAG_SIM__FRICTION", "0.6")
    monkeypatch.setenv("TRACE_DAG_ROOT", "/somewhere")
    file = b"[sim]\nfriction = 0.5\nrestitution = 0.2\n[states]\nmax_hypotheses = 2\n"
    settings = load_settings(file, overrides={"states": {"estimator": "llm"}})
    assert (settings.sim.friction, settings.sim.restitution) == (0.6, 0.2)
    assert (settings.states.max_hypotheses, settings.states.estimator) == (2, "llm")


def test_null_in_the_environment_is_no_limit(monkeypatch):
    monkeypatch.setenv("TRACE_DAG_CRASH__VEHICLES", "null")
    assert load_settings().crash.vehicles is None


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (b"[sim]\nfriction = -1", r"setting sim.friction = -1 .*greater than 0"),
        (b"[sim]\nfrictoin = 1", r"setting sim.frictoin = 1 .*not permitted"),
        (b"[sim\n", "settings.toml: not TOML"),
        (b"\xff", "settings.toml: not TOML"),
    ],
)
def test_mistakes_are_named(file, said):
    with pytest.raises(UserError, match=said):
        load_settings(file)
