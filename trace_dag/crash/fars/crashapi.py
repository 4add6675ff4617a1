"""NHTSA's CrashAPI as a source: find the cases of states and years, fetch each one's report as XML.

https://crashviewer.nhtsa.dot.gov/CrashAPI. Every answer is checked before it is used or cached. An error page with
status 200, an answer that breaks off or the report of another case is wrong, and the request is repeated. A case
without a report (``Count`` 0) is a correct answer.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from trace_dag.common.errors import Failure, Rejection, UserError
from trace_dag.common.network.http import HttpClient
from trace_dag.crash.codes.elements import STATES
from trace_dag.crash.folder import identify
from trace_dag.crash.keys import crash_key, fars_case, state_of
from trace_dag.crash.listing import CrashListing

BASE_URL: Final = "https://crashviewer.nhtsa.dot.gov/CrashAPI"
LIST_LIMIT: Final = 5000
"""Records a list call returns at most: it is asked state by state and year by year, and a full list is an error."""

_END_OF_RESPONSE: Final = b"</ResponseOfListOfCaseDetail>"


@dataclass(frozen=True)
class CrashApiClient:
    """The two calls a cohort needs."""

    http: HttpClient
    base_url: str = BASE_URL

    def list_cases(
        self, states: Iterable[int], years: Iterable[int], *, min_vehicles: int = 1, max_vehicles: int = 99
    ) -> list[CrashListing]:
        """Return the cases of those states (``STATE`` codes) and years with that many motor vehicles, in order of keys.

        The service counts every motor vehicle, parked ones too. It lists neither place nor crash type, so filters on
        those need the reports.

        Raises UserError for an unknown state, and TransientFailure or Failure as :class:`HttpClient`.
        """
        found: dict[str, CrashListing] = {}
        year_list = sorted(set(years))
        for state in sorted(set(states)):
            if state not in STATES:
                raise UserError(f"{state} is not a state code; expected one of {', '.join(map(str, STATES))}")
            for year in year_list:
                for listing in self._list(state, year, min_vehicles, max_vehicles):
                    found[listing.key] = listing
        return [found[key] for key in sorted(found)]

    def report(self, key: str) -> bytes:
        """Return the report of a crash as served.

        If the service has no such report, this is its answer with ``Count`` 0.

        Raises UserError for a malformed key, and TransientFailure or Failure as :class:`HttpClient`.
        """
        year, state_case = fars_case(key)
        params = {
            "stateCase": str(state_case),
            "caseYear": str(year),
            "state": str(state_of(state_case)),
            "format": "xml",
        }
        return self.http.get(
            f"{self.base_url}/crashes/GetCaseDetails",
            params,
            check=lambda body: _wrong_report(body, key),
            lasts=_holds_case,
        )

    def _list(self, state: int, year: int, min_vehicles: int, max_vehicles: int) -> list[CrashListing]:
        params = {
            "states": str(state),
            "fromYear": str(year),
            "toYear": str(year),
            "minNumOfVehicles": str(min_vehicles),
            "maxNumOfVehicles": str(max_vehicles),
            "format": "json",
        }
        body = self.http.get(
            f"{self.base_url}/crashes/GetCaseList", params, check=lambda answer: _wrong_list(answer, state)
        )
        cases = _cases(body)
        if len(cases) >= LIST_LIMIT:
            raise Failure(
                f"GetCaseList for state {state}, {year}: {len(cases)} cases, the most it lists; ask for it in parts by "
                "number of vehicles"
            )
        return [
            CrashListing(
                key=crash_key(year, int(case["St_Case"])),
                case_year=year,
                state_case=int(case["St_Case"]),
                county_name=str(case.get("CountyName") or ""),
            )
            for case in cases
        ]


def _wrong_report(body: bytes, key: str) -> str | None:
    """Return the fault of an answer to ``GetCaseDetails``, or None if it is right."""
    try:
        found = identify(body, name="the answer")
    except Rejection as rejection:
        return rejection.detail
    if found is None:
        return "no crash report (an error page?)"
    if found[0] != key:
        return f"the report of crash {found[0]}, not of {key}"
    # Labels with a bare & are the service's own doing and no reason to ask again; a missing end is.
    return None if body.rstrip().endswith(_END_OF_RESPONSE) else "the report ends in the middle"


def _holds_case(body: bytes) -> bool:
    """Return whether an answer has the case; an unreleased one may be released later."""
    found = identify(body, name="the answer")
    return found is not None and found[1]


def _wrong_list(body: bytes, state: int) -> str | None:
    try:
        cases = _cases(body)
        strange = [case["St_Case"] for case in cases if state_of(int(case["St_Case"])) != state]
    except (ValueError, KeyError, TypeError) as error:
        return f"no list of cases ({type(error).__name__}: {error})"
    return f"case {strange[0]}, which is not of state {state}" if strange else None


def _cases(body: bytes) -> list[dict[str, Any]]:
    """Return the cases of a ``GetCaseList`` answer, whose ``Results`` is a nested list.

    Raises ValueError for other answers.
    """
    answer = json.loads(body)
    results = answer["Results"] if isinstance(answer, dict) else None
    if not isinstance(results, list):
        raise ValueError("no Results")
    return [case for group in results for case in (group if isinstance(group, list) else [group])]
