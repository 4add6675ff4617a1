"""Settings from the root's file, the environment and the caller."""

from __future__ import annotations

import pytest

from trace_dag.common.errors import UserError, UserErrors
from trace_dag.common.settings import Settings
from trace_dag.common.settings_sources import load_settings


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
        (b"[execution]\nworkers = -1", r"setting execution.workers = -1 .*greater than or equal to 1"),
        (b"[execution]\nworkers = 0", r"setting execution.workers = 0 .*greater than or equal to 1"),
        pytest.param(b"a = " + b"[" * 100_000, "settings.toml: not TOML", id="nested"),
        (b"[sim]\nfriction = -1", r"setting sim.friction = -1 .*greater than 0"),
        (b"[sim]\nfrictoin = 1", r"from settings.toml\): there is no such setting; did you mean sim.friction"),
        (b"[simm]\nfriction = 1", r"there is no such section; did you mean sim"),
        (b"[crash]\nkinds = 'two_vehicles'", r"setting crash.kinds = 'two_vehicles' .*expected a list"),
        (b"[sim\n", "settings.toml: not TOML"),
        (b"\xff", "settings.toml: not TOML"),
    ],
)
def test_mistakes_are_named(file, said):
    with pytest.raises(UserError, match=said):
        load_settings(file)


def test_every_mistake_has_its_line():
    file = b"[sim]\nfriction = -1\nfrictoin = 1\n[osm]\nradius_m = 'far'\n"
    with pytest.raises(UserErrors) as raised:
        load_settings(file)
    assert sorted(said.split()[1] for said in raised.value.messages) == ["osm.radius_m", "sim.friction", "sim.frictoin"]


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("TRACE_DAG_EXECUTION__WORKERS", "-1", "execution.workers"),
        ("TRACE_DAG_EXECUTION__WORKERS", "many", "execution.workers"),
        ("TRACE_DAG_CRASH__FILTERS", "{broken", "TRACE_DAG_CRASH__FILTERS = '{broken': expected JSON"),
        ("TRACE_DAG_CRASH__FILTERS", "[" * 100_000, "TRACE_DAG_CRASH__FILTERS"),
        ("TRACE_DAG_CRASH", "{broken", "TRACE_DAG_CRASH = '{broken': expected JSON"),
        (
            "TRACE_DAG_SIMM__FRICTION",
            "0.5",
            "TRACE_DAG_SIMM__FRICTION: there is no section simm; did you mean TRACE_DAG_SIM__",
        ),
        ("TRACE_DAG_XYZ__FRICTION", "0.5", "sections are crash, osm"),
        ("TRACE_DAG_SIM_FRICTION", "0.5", "expected TRACE_DAG_SIM__FRICTION"),
        (
            "TRACE_DAG_SIM__FRICTOIN",
            "0.5",
            "setting sim.frictoin = '0.5' (from environment variable TRACE_DAG_SIM__FRICTOIN): "
            "there is no such setting; did you mean sim.friction? trace-dag settings lists them",
        ),
    ],
)
def test_mistakes_in_the_environment_are_named(monkeypatch, variable, value, said):
    monkeypatch.setenv(variable, value)
    with pytest.raises(UserError) as raised:
        load_settings()
    assert said in str(raised.value)
    assert len(str(raised.value)) < 1000
