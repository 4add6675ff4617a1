"""Values for Dagster's Helm chart agree with each other and with our settings; the chart knows nothing of either."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from sqlalchemy.engine import make_url

from trace_dag.common.settings import Settings
from trace_dag.common.settings_sources import load_settings
from trace_dag.version import __version__

VALUES = Path(__file__).resolve().parents[1] / "deploy" / "values.yaml"


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    return yaml.safe_load(VALUES.read_text())


@pytest.fixture
def location(values: dict[str, Any]) -> dict[str, Any]:
    """The code location."""
    (only,) = values["dagster-user-deployments"]["deployments"]
    return only


@pytest.fixture
def settings(location: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> Settings:
    """Ours, as a run pod reads them from the environment that the values give it."""
    for variable in location["env"]:
        monkeypatch.setenv(variable["name"], variable["value"])
    return load_settings()


def test_run_pods_get_the_resources_of_the_run_launcher(location: dict[str, Any]) -> None:
    # https://github.com/dagster-io/dagster/issues/22766: those of the code location would be put over them.
    assert location["includeConfigInLaunchedRuns"]["enabled"]
    assert "resources" not in location


def test_a_run_pod_has_a_core_for_each_of_its_processes(values: dict[str, Any], settings: Settings) -> None:
    container = values["runLauncher"]["config"]["k8sRunLauncher"]["runK8sConfig"]["containerConfig"]
    assert settings.execution.workers == int(container["resources"]["requests"]["cpu"])


def test_pods_run_as_the_user_of_the_image_and_may_not_become_another(
    values: dict[str, Any], location: dict[str, Any]
) -> None:
    container = values["runLauncher"]["config"]["k8sRunLauncher"]["runK8sConfig"]["containerConfig"]
    image = (VALUES.parent / "Dockerfile").read_text()
    for context in (location["securityContext"], container["securityContext"]):
        assert f"--uid {context['runAsUser']} crash" in image
        assert context["runAsNonRoot"]
        assert not context["allowPrivilegeEscalation"]
        assert context["capabilities"] == {"drop": ["ALL"]}


def test_all_runs_together_ask_public_services_at_the_rate_of_one_machine(
    values: dict[str, Any], settings: Settings
) -> None:
    queue = values["dagsterDaemon"]["runCoordinator"]["config"]["queuedRunCoordinator"]
    assert settings.services.requests_per_s * queue["maxConcurrentRuns"] == Settings().services.requests_per_s


def test_the_image_is_that_of_this_version(location: dict[str, Any]) -> None:
    assert location["image"]["tag"] == __version__


def test_the_database_is_reached_with_the_driver_that_is_installed(values: dict[str, Any]) -> None:
    # dagster-postgres requires psycopg2; without a name SQLAlchemy 2.1 takes psycopg.
    url = make_url(values["postgresql"]["postgresqlScheme"] + "://")
    assert url.get_driver_name() == "psycopg2"


def test_registered_crashes_become_partitions(settings: Settings) -> None:
    # A command on another machine cannot tell the cluster's Dagster; a schedule of the root does.
    assert [schedule.cohort for schedule in settings.automation.schedules] == [None]


def test_names_of_services_are_not_taken_for_settings(
    location: dict[str, Any], settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Kubernetes tells every pod where the services of its namespace are: TRACE_DAG_SERVICE_HOST, TRACE_DAG_PORT, ...
    # https://kubernetes.io/docs/concepts/services-networking/service/#environment-variables
    service = location["name"].upper().replace("-", "_")
    port = location["port"]
    for name in ("SERVICE_HOST", "SERVICE_PORT", "SERVICE_PORT_GRPC", "PORT", f"PORT_{port}_TCP"):
        monkeypatch.setenv(f"{service}_{name}", f"tcp://10.0.0.7:{port}")
    assert load_settings() == settings
