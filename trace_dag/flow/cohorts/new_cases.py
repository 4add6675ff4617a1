"""Cases that the CrashAPI has released since a cohort was chosen: registering them, and asking again for those awaited.

A cohort follows the service with the choices it was made with (``trace-dag ingest --crashapi ... --watch``). A case
that was listed before its report was released is rejected as ``not_released``, and requested again later.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection
from dataclasses import dataclass

from trace_dag.common.errors import UserError
from trace_dag.common.settings import ServiceSettings
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.registry import Registry, in_order
from trace_dag.flow.cohorts.services import crash_api

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class NewCases:
    """Result of a query: the number of cohorts that follow the service, new cases, and cases still awaited."""

    followers: int
    added: tuple[str, ...] = ()
    awaited: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Return all crashes whose report is to be requested."""
        return tuple(in_order((*self.added, *self.awaited)))


def register_new_cases(
    storage: Storage, services: ServiceSettings, not_released: Callable[[Collection[str]], Collection[str]]
) -> NewCases:
    """Request the lists of cases again for every cohort that follows the service, and register new cases.

    ``not_released`` returns those of some crashes that had no report at the last request. Raises TransientFailure or
    Failure if the service does not answer; earlier registrations stay.
    """
    cohorts = [cohort for cohort in Registry(storage).cohorts().values() if cohort.followed]
    added: list[str] = []
    awaited: list[str] = []
    for cohort in cohorts:
        awaited += not_released([key for key, report in cohort.reports.items() if report.kind == "crashapi"])
        for choice in cohort.followed:
            try:
                found = ingest(
                    storage,
                    cohort.name,
                    crash_api=crash_api(services, storage),
                    case_lists=crash_api(services, storage, refresh=True),
                    choice=choice,
                )
            except UserError as error:  # the service lists no such case yet
                log.warning("cohort %s: %s", cohort.name, error)
                continue
            added += found.registration.added
    return NewCases(len(cohorts), tuple(in_order(added)), tuple(in_order(awaited)))
