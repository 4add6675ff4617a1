"""Reports made for tests: a small, complete one in CrashAPI XML whose every element can be changed; and what is made of
them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import escape

from trace_dag.common.errors import Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.crash.completeness import Rule, check
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord

Children = dict[str, Any]

CRASH: Children = {
    "CaseYear": 2023, "State": 51, "ST_CASE": 519001, "STATENAME": "Virginia", "VE_TOTAL": 2, "VE_FORMS": 2,
    "COUNTYNAME": "SOMEWHERE (1)", "CITYNAME": "NOT APPLICABLE", "DAY": 5, "MONTH": 1, "YEAR": 2023, "HOUR": 14,
    "MINUTE": 40, "RUR_URB": 1, "FUNC_SYS": 4, "ROUTE": 2, "TWAY_ID": "US-1", "TWAY_ID2": "MAIN ST",
    "LATITUDE": "37.5", "LONGITUD": "-77.5", "HARM_EV": 12, "MAN_COLL": 6, "RELJCT2": 2, "TYP_INT": 2, "REL_ROAD": 1,
    "LGT_COND": 1, "WEATHER": 1, "FATALS": 1,
}  # fmt: skip
VEHICLE: Children = {
    "VEH_NO": 1, "UNITTYPE": 1, "HIT_RUN": 0, "BODY_TYP": 4, "MOD_YEAR": 2013, "TOW_VEH": 0, "TRAV_SP": 35,
    "ROLLOVER": 0, "IMPACT1": 12, "SPEEDREL": 0, "VTRAFWAY": 1, "VNUM_LAN": 2, "VSPD_LIM": 35, "VALIGN": 1,
    "VPROFILE": 1, "VSURCOND": 1, "VTRAFCON": 3, "P_CRASH1": 1, "P_CRASH2": 17, "P_CRASH3": 99,
    "PCRASH4NAME": "Tracking", "PCRASH5": 1, "ACC_TYPE": 86,
}  # fmt: skip
EVENT: Children = {"EVENTNUM": 1, "SOE": 12, "VNUMBER1": 1, "AOI1": 12, "VNUMBER2": 2, "AOI2": 3}


def report(
    crash: Children | None = None,
    vehicles: list[Children] | None = None,
    events: list[Children] | None = None,
    lists: dict[str, list[tuple[str, Children]]] | None = None,
) -> bytes:
    """A response with one crash: two cars on crossing paths, unless told otherwise. None as a value leaves it out."""
    pair = [{}, {"VEH_NO": 2, "IMPACT1": 3, "ACC_TYPE": 87, "P_CRASH2": 66}] if vehicles is None else vehicles
    members = {
        "Vehicles": [("Vehicle", VEHICLE | each) for each in pair],
        "CEvents": [("CEvent", EVENT | each) for each in ([{}] if events is None else events)],
        **(lists or {}),
    }
    content = _elements(CRASH | (crash or {})) + "".join(
        f"<{name}>{''.join(f'<{tag}>{_elements(entry)}</{tag}>' for tag, entry in entries)}</{name}>"
        for name, entries in members.items()
    )
    case = (CRASH | (crash or {})).get("ST_CASE")
    return (
        "<?xml version='1.0' encoding='UTF-8'?>\n<ResponseOfListOfCaseDetail><Count>1</Count>"
        f"<Message>Results returned successfully</Message><SearchCriteria>StateCase: {case} And CaseYear: 2023 And "
        "State: 51</SearchCriteria><Results><ArrayOfCaseDetail><CaseDetail><CrashResultSet>"
        f"{content}</CrashResultSet></CaseDetail></ArrayOfCaseDetail></Results></ResponseOfListOfCaseDetail>"
    ).encode()


def read(data: bytes) -> CrashRecord:
    """The report, read with the usual settings."""
    return read_report(data, name="report.xml", settings=CrashSettings())


def rejection(record: CrashRecord, settings: CrashSettings) -> Rejection | None:
    """Why a record is not taken; None where it is."""
    try:
        check(record, settings)
    except Rejection as found:
        return found
    return None


def shortcomings(record: CrashRecord, rules: Sequence[Rule]) -> list[str]:
    """The sentence of each rule that a record falls short of."""
    return [detail for rule in rules if (detail := rule.shortcoming(record)) is not None]


def parties(record: CrashRecord) -> list[tuple[int, int | None, int | None]]:
    """Of each event its code and both parties."""
    return [(event.code, event.party_1, event.party_2) for event in record.events]


def own_events(*rows: tuple[int | None, int]) -> list[tuple[str, Children]]:
    """The list ``VSOEs`` of a vehicle: SOE (None where blank) and AOI of each."""
    return [("VSOEs", {"VEVENTNUM": n, "SOE": soe, "AOI": aoi}) for n, (soe, aoi) in enumerate(rows, start=1)]


def not_released(state_case: int = 519001, year: int = 2023) -> bytes:
    """The answer for a case that is not there."""
    return (
        "<ResponseOfListOfCaseDetail><Count>0</Count><Message>No results found</Message><SearchCriteria>StateCase: "
        f"{state_case} And CaseYear: {year} And State: {state_case // 10000}</SearchCriteria><Results />"
        "</ResponseOfListOfCaseDetail>"
    ).encode()


def _elements(children: Children) -> str:
    return "".join(f"<{name}>{_value(value)}</{name}>" for name, value in children.items() if value is not None)


def _value(value: Any) -> str:
    if isinstance(value, list):
        return "".join(f"<{tag}>{_elements(entry)}</{tag}>" for tag, entry in value)
    return escape(str(value))
