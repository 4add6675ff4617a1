"""Cohorts on the command line: made from every source, listed, shown, extended, removed."""

from __future__ import annotations

import json

import click
import pytest
from public_services import MAP, NOT_RELEASED, SAMPLE, VERIFIED, public_services
from sample_runs import trace_dag

from trace_dag.cli.main import cli
from trace_dag.common.errors import UserError

REPORTS = str(SAMPLE / "reports")


def partitions(root):
    from trace_dag.assets.launch import open_instance
    from trace_dag.flow.stages import FLOW
    from trace_dag.flow.workspace import Workspace

    with open_instance(Workspace.open(str(root), FLOW)) as instance:
        return list(instance.get_dynamic_partitions("crashes"))


def test_from_the_services_to_the_verdict(tmp_path):
    with public_services() as api:
        api.cases = (VERIFIED[0], NOT_RELEASED)
        environment = {
            f"TRACE_DAG_SERVICES__{name.upper()}": json.dumps(value) if isinstance(value, tuple) else str(value)
            for name, value in api.settings.items()
        }
        nebraska = ("--crashapi", "--states", "NE", "--years", "2023", "--vehicles", "2")
        done = trace_dag(tmp_path, "ingest", *nebraska, "--maps", "overpass", "--cohort", "ne", **environment)
        assert done.returncode == 0, done.stderr
        assert "2 crashes registered" in done.stdout
        done = trace_dag(tmp_path, "run", "--executor", "in_process", **environment)
        assert done.returncode == 0, done.stderr
    crashes = json.loads(trace_dag(tmp_path, "status", "--json").stdout)["crashes"]
    assert crashes[f"2023-{VERIFIED[0]}"]["final_state"] == "verified"
    assert crashes[f"2023-{NOT_RELEASED}"]["reason"] == "not_released"


def test_cohorts_are_made_extended_listed_shown_and_removed(tmp_path, monkeypatch):
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    sampled = ("ingest", "--reports", REPORTS, "--cohort", "some", "--maps", str(MAP), "--sample")
    assert "5 crashes registered" in trace_dag(tmp_path, *sampled, "5").stdout
    grown = trace_dag(tmp_path, *sampled, "8", "--seed", "1")
    assert "3 crashes registered, 5 known already" in grown.stdout
    trace_dag(tmp_path, "ingest", "--reports", REPORTS, "--cohort", "one", "--cases", "2023-319061")

    listed = {each["name"]: each for each in json.loads(trace_dag(tmp_path, "cohort", "list", "--json").stdout)}
    assert {name: each["crashes"] for name, each in listed.items()} == {"one": 1, "some": 8}
    assert listed["some"]["origins"] == ["reports: sample of 5, seed 1", "reports: sample of 8, seed 1"]
    shown = json.loads(trace_dag(tmp_path, "cohort", "show", "some", "--json").stdout)
    keys = list(shown["reports"])
    assert len(keys) == 8
    assert set(partitions(tmp_path)) == {*keys, "2023-319061"}
    assert "sample of 8, seed 1" in trace_dag(tmp_path, "cohort", "show", "some").stdout
    assert "some" in trace_dag(tmp_path, "cohort", "list").stdout

    assert trace_dag(tmp_path, "cohort", "remove", "some", "--only", *keys[:2]).returncode == 0
    assert set(partitions(tmp_path)) == {*keys[2:], "2023-319061"}
    assert trace_dag(tmp_path, "cohort", "remove", "some").returncode == 0
    assert partitions(tmp_path) == ["2023-319061"]
    assert [each["name"] for each in json.loads(trace_dag(tmp_path, "cohort", "list", "--json").stdout)] == ["one"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ingest", "--crashapi"], "which cases"),
        (["ingest", "--crashapi", "--states", "Atlantis", "--years", "2023"], "'Atlantis' is not a state"),
        (["ingest", "--reports", REPORTS, "--years", "23"], "--years 23"),
        (["ingest", "--reports", REPORTS, "--years", "2023-2020"], "--years 2023-2020"),
        (["ingest", "--reports", REPORTS, "--vehicles", "two"], "--vehicles two"),
        (["ingest", "--reports", REPORTS, "--box", "40", "-97", "39", "-98"], "south, west, north, east"),
        (["ingest", "--reports", REPORTS, "--road-classes", "footpath"], "--road-classes footpath"),
        (["ingest", "--reports", REPORTS, "--sample", "0"], "--sample"),
        (["ingest", "--reports", REPORTS, "--sample", "2", "--stratified", "2"], "choose one"),
        (["ingest", "--reports", REPORTS, "--cases", "319061"], "not a crash key"),
        (["ingest", "--reports", REPORTS, "--states", "VA"], "no crash that is asked for (VA)"),
        (["ingest", "--maps", "overpass", "osm-api"], "one service"),
        (["ingest", "--maps", "overpass", "--watch"], "--watch needs --reports"),
        (["ingest", "--fars-csv", "/nowhere"], "/nowhere does not exist"),
        (["cohort", "show", "nowhere"], "'nowhere' is not registered"),
        (["cohort", "remove", "nowhere"], "'nowhere' is not registered"),
    ],
)
def test_impossible_requests_are_refused_in_one_line(tmp_path, arguments, said):
    """In this process: that both kinds of exception end the command with one line and code 2 is tested elsewhere."""
    with pytest.raises((UserError, click.ClickException)) as caught:
        cli.main(["--root", str(tmp_path), *arguments], standalone_mode=False)
    message = caught.value.format_message() if isinstance(caught.value, click.ClickException) else str(caught.value)
    assert said in message
    assert "\n" not in message
    assert not (tmp_path / "cohorts").exists()


def test_the_places_of_a_cohort_become_a_configuration_of_osmium(tmp_path):
    config = tmp_path / "crashes.json"
    trace_dag(tmp_path, "ingest", "--reports", REPORTS, "--cases", "2023-319003", "--cohort", "one")
    done = trace_dag(tmp_path, "cohort", "osmium", "one", "--output", str(config))
    assert "the places of 1 of 1 crash" in done.stdout, done.stderr
    (area,) = json.loads(config.read_bytes())["extracts"]
    assert area["output"] == "crashes.osm.pbf"
    (((*corners, _),),) = area["multipolygon"]
    longitudes, latitudes = zip(*corners, strict=True)
    # 300 m and a margin of 500 m to each side; a degree of latitude has 111.2 km, one of longitude cos 41.8 of it.
    assert max(latitudes) - min(latitudes) == pytest.approx(1600 / 111_195, rel=1e-3)
    assert max(longitudes) - min(longitudes) == pytest.approx(1600 / 82_890, rel=1e-2)
