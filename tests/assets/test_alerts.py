"""Alerts: who asked for them hears of crashes that fail, that are verified no more, and that the budget stopped."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import fake_flow
import pytest
from loopback import Answer, serving

from trace_dag.assets.launch import summarise
from trace_dag.assets.summaries import standings_in
from trace_dag.common.network.alerts import WEBHOOK_VARIABLE, Alert, AlertKind, send
from trace_dag.common.settings import AutomationSettings

KEYS = [f"2023-5100{number}" for number in range(10, 13)]
WRITES = "import sys; open(sys.argv[1], 'a').write(sys.stdin.read() + chr(10))"


class Inbox:
    """Where a program puts the alerts that it is given."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "alerts.jsonl"
        self.settings = {
            "automation": {"alert_command": [sys.executable, "-c", WRITES, str(self.path)]},
            "execution": {"executor": "in_process"},
        }

    def taken(self) -> list[tuple[str, list[str]]]:
        """What has come since the last time: kind, and the crashes it names."""
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        self.path.unlink(missing_ok=True)
        return [(said["kind"], [crash["key"] for crash in said["crashes"]]) for said in map(json.loads, lines)]


def test_crashes_that_fail_and_that_are_verified_no_more_are_reported_once(campaign, tmp_path):
    inbox = Inbox(tmp_path)
    made = campaign(dict(zip(KEYS, ["", "", "fail:simulation_log"], strict=True)))
    workspace = made.workspace.with_settings(inbox.settings)

    def summarised() -> list[tuple[str, list[str]]]:
        summarise(workspace, made.instance)
        return inbox.taken()

    made.run()
    assert summarised() == [("failed", [KEYS[2]])]
    assert summarised() == [], "it has been told"
    changed = fake_flow.write_reports(tmp_path / "changed", {KEYS[1]: "reject:verdict"})
    made.workspace.registry.register("fakes", changed)
    made.run()
    assert summarised() == [("no_longer_verified", [KEYS[1]])]


def test_a_crash_that_the_budget_stopped_is_reported_as_such(campaign, tmp_path):
    inbox = Inbox(tmp_path)
    made = campaign({KEYS[0]: "", KEYS[1]: "broke:state_estimate", KEYS[2]: "fail:state_estimate"})
    made.run()
    summarise(made.workspace.with_settings(inbox.settings), made.instance)
    assert inbox.taken() == [("budget_spent", [KEYS[1]]), ("failed", [KEYS[2]])]


def test_without_a_warehouse_there_is_nothing_to_compare_with(tmp_path):
    assert standings_in(tmp_path / "warehouse.duckdb") == {}


def test_a_web_hook_is_sent_the_alert_and_its_address_is_no_ones_business(monkeypatch, caplog):
    alert = Alert(AlertKind.RUN_FAILED, "home", "trace-dag home: a run failed")
    with serving(lambda request, before: Answer(status=503 if before == 0 else 200)) as hook:
        monkeypatch.setenv(WEBHOOK_VARIABLE, f"{hook.url}/secret")
        send(alert, AutomationSettings())
        assert [json.loads(request.body)["text"] for request in hook.requests] == [alert.text, alert.text]
    assert not caplog.text
    with serving(lambda *_: Answer(status=404)) as hook:
        monkeypatch.setenv(WEBHOOK_VARIABLE, f"{hook.url}/secret")
        send(alert, AutomationSettings())
    assert "404" in caplog.text
    assert "secret" not in caplog.text


@pytest.mark.parametrize(
    ("command", "said"),
    [(("no-such-program",), "no-such-program"), ((sys.executable, "-c", "raise SystemExit(3)"), "ended with 3")],
)
def test_an_alert_that_cannot_be_delivered_is_a_warning(monkeypatch, caplog, command, said):
    monkeypatch.delenv(WEBHOOK_VARIABLE, raising=False)
    send(Alert(AlertKind.RUN_FAILED, "home", "it failed"), AutomationSettings(alert_command=command))
    assert said in caplog.text
