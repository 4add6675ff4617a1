"""Cases that the CrashAPI has released since a cohort was chosen: registering them, and asking again for those awaited.

A cohort follows the service by the choices it was made with (``trace-dag ingest --crashapi ... --watch``). A case that
was listed before its report was released stands rejected as ``not_released``; it is worth asking for again.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

from trace_dag.errors import Reason, Stage, UserError
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.ingest import ingest
from trace_dag.pipeline.records import read_records
from trace_dag.pipeline.registry import in_order
from trace_dag.pipeline.services import crash_api

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Releases:
    """A look at the service: how many cohorts follow it, cases listed for the first time, and cases still awaited."""

    followers: int
    added: tuple[str, ...] = ()
    awaited: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """All crashes whose report is to be asked for."""
        return tuple(in_order((*self.added, *self.awaited)))


def register_releases(pipeline: Pipeline) -> Releases:
    """Ask the service for the lists of cases again, for every cohort that follows it, and register what is new.

    Raises TransientFailure or Failure where the service does not answer; what was registered before that stays.
    """
    services, storage = pipeline.settings.services, pipeline.storage
    cohorts = [cohort for cohort in pipeline.registry.cohorts().values() if cohort.followed]
    added: list[str] = []
    awaited: list[str] = []
    for cohort in cohorts:
        asked = [key for key, report in cohort.reports.items() if report.kind == "crashapi"]
        awaited += [
            key
            for key, records in read_records(storage, asked, [Stage.RAW_REPORT]).items()
            if any(record.reason is Reason.NOT_RELEASED for record in records.values())
        ]
        for choice in cohort.followed:
            try:
                found = ingest(
                    storage,
                    cohort.name,
                    crash_api=crash_api(services, storage),
                    case_lists=crash_api(services, storage, refresh=True),
                    choice=choice,
                )
            except UserError as error:  # nothing of what is asked for is listed yet
                log.warning("cohort %s: %s", cohort.name, error)
                continue
            added += found.registration.added
    return Releases(len(cohorts), tuple(in_order(added)), tuple(in_order(awaited)))
