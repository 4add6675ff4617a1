"""Alerts about problems, sent to a program or a web hook.

Belongs here: the text of an alert, and its delivery. Does not belong here: noticing what is worth one
(:mod:`trace_dag.assets.summaries`, :mod:`trace_dag.assets.automation`). An alert that cannot be delivered is a warning
in the log and stops nothing.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Final

from trace_dag.common.errors import Failure
from trace_dag.common.settings import AutomationSettings

WEBHOOK_VARIABLE: Final = "TRACE_DAG_ALERT_WEBHOOK"
"""Names the web hook's address. It is not a setting: who knows it may post, so it is kept out of files and listings."""
_NAMED: Final = 20
_COMMAND_TIME_S: Final = 60.0

log = logging.getLogger(__name__)


class AlertKind(StrEnum):
    """Subjects of alerts."""

    FAILED = "failed"
    NO_LONGER_VERIFIED = "no_longer_verified"
    BUDGET_SPENT = "budget_spent"
    RUN_FAILED = "run_failed"


@dataclass(frozen=True)
class AlertedCrash:
    """A crash that an alert names: where it stands, and in a sentence why."""

    key: str
    stage: str
    reason: str
    detail: str


@dataclass(frozen=True)
class Alert:
    """An event at a root, in a line, with its crashes."""

    kind: AlertKind
    root: str
    text: str
    crashes: Sequence[AlertedCrash] = ()

    @classmethod
    def of_crashes(cls, kind: AlertKind, root: str, what: str, crashes: Sequence[AlertedCrash]) -> Alert:
        """Return an alert about crashes; its line names the first one.

        >>> gone = AlertedCrash("2023-1", "verdict", "wrong_impact", "Struck elsewhere.")
        >>> Alert.of_crashes(AlertKind.NO_LONGER_VERIFIED, "home", "no longer verified", [gone]).text
        'trace-dag home: 1 crash no longer verified: 2023-1 (wrong_impact: Struck elsewhere.)'
        """
        first = crashes[0]
        said = f"{first.reason}: {first.detail}" if first.reason else first.detail
        more = f" and {len(crashes) - 1} more" if len(crashes) > 1 else ""
        number = f"{len(crashes)} crash{'es' if len(crashes) > 1 else ''}"
        return cls(
            kind, root, f"trace-dag {root}: {number} {what}: {first.key} ({said}){more}", tuple(crashes[:_NAMED])
        )


def alerts_go_out(settings: AutomationSettings) -> bool:
    """Return whether an alert command or a web hook is set."""
    return bool(settings.alert_command or os.environ.get(WEBHOOK_VARIABLE))


def send(alert: Alert, settings: AutomationSettings) -> None:
    """Deliver an alert to every configured address."""
    document = asdict(alert)
    if settings.alert_command:
        _run(settings.alert_command, json.dumps(document))
    if address := os.environ.get(WEBHOOK_VARIABLE):
        from trace_dag.common.network.http import send_json  # a tenth of a run's start-up, and few ask for alerts

        try:
            send_json(address, document)
        except Failure as failure:
            log.warning("alert not delivered: %s", failure)


def _run(command: Sequence[str], document: str) -> None:
    try:
        done = subprocess.run(  # noqa: S603 - whoever writes the settings says which program
            command, input=document, text=True, capture_output=True, timeout=_COMMAND_TIME_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        log.warning("alert not delivered: %s: %s", command[0], error)
        return
    if done.returncode:
        log.warning("alert not delivered: %s ended with %d: %s", command[0], done.returncode, done.stderr.strip()[:200])
