"""Plugins: those of this package and of others are registered alike, and one that cannot be had is said in a line."""

from __future__ import annotations

from importlib.metadata import EntryPoints
from pathlib import Path

import pytest
from sample_runs import trace_dag_process

from trace_dag.common.errors import UserError
from trace_dag.common.plugins import PluginKind, list_plugins, load


@pytest.mark.parametrize("kind", PluginKind)
def test_built_in_plugins_are_registered_like_others(kind: PluginKind) -> None:
    assert {each.package for each in list_plugins(kind).values() if each.is_ours} <= {"trace-dag"}
    assert all(callable(load(kind, name)) for name in list_plugins(kind))


def test_an_unknown_name_is_reported_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="no backend 'beamng' is installed; expected one of carla, embedded"):
        load(PluginKind.BACKEND, "beamng")


def test_an_installation_older_than_a_kind_of_plugins_asks_to_install_again(monkeypatch) -> None:
    list_plugins.cache_clear()
    monkeypatch.setattr("trace_dag.common.plugins._installed", lambda: EntryPoints(()))
    try:
        with pytest.raises(UserError, match=r"has no estimator.*pip install -e \."):
            load(PluginKind.ESTIMATOR, "analytic")
    finally:
        list_plugins.cache_clear()


def test_a_setting_that_names_no_plugin_is_one_line(tmp_path: Path) -> None:
    done = trace_dag_process(tmp_path, "run", TRACE_DAG_ROADS__CONVERTER="beamng")
    assert done.returncode == 2
    assert "setting roads.converter = 'beamng'" in done.stderr
    assert "native, osm2odr" in done.stderr
