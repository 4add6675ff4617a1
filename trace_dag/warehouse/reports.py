"""Facts known before any stage has run: the reports' listings, and the names of states."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import Rejection
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import JUDGED_KINDS, CrashKind
from trace_dag.crash.codes import crash, events, persons, vehicle
from trace_dag.crash.codes.crash import STATES
from trace_dag.crash.codes.odd import ODD
from trace_dag.crash.listing import CrashListing
from trace_dag.crash.parse import reported_position
from trace_dag.flow.cohorts.listings import listings_of
from trace_dag.flow.cohorts.registry import Cohort

if TYPE_CHECKING:
    import pyarrow as pa

_CODES = (
    *(crash.FUNC_SYS, crash.LGT_COND, crash.MAN_COLL, crash.REL_ROAD, crash.RELJCT2, crash.RUR_URB, crash.TYP_INT),
    *(crash.WEATHER, events.HARM_EV, events.IMPACT1, events.SOE, persons.PEDCGP, persons.BIKECGP),
    *(vehicle.ACC_TYPE, vehicle.P_CRASH1, vehicle.P_CRASH2, vehicle.VALIGN, vehicle.VPROFILE, vehicle.VSURCOND),
    *(vehicle.J_KNIFE, vehicle.VTRAFCON, vehicle.VTRAFWAY),
    *(persons.SEX, persons.LOCATION, persons.NMACTION, persons.NMCC, persons.MSAFEQMT, *persons.EQUIPMENT),
    *(persons.PBCWALK, persons.PBSWALK, persons.PBSZONE, persons.PEDLOC, persons.PEDPOS, persons.BIKEPOS),
    *(persons.PEDDIR, persons.BIKEDIR, persons.MOTDIR, persons.MOTMAN, persons.PEDLEG, crash.PER_TYP),
)
_POSITION = ("latitude_deg", "longitude_deg")


def unread_reports(storage: Storage, cohorts: Iterable[Cohort], crash_statuses: pa.Table) -> pa.Table:
    """Return one row per crash that no stage has read yet but whose report is at hand."""
    import pyarrow as pa

    reports = {key: report for cohort in cohorts for key, report in cohort.reports.items()}
    unread = [
        row["key"]
        for row in crash_statuses.select(["key", "stage_reached"]).to_pylist()
        if row["stage_reached"] in (None, Stage.RAW_REPORT.value)
    ]
    listings = listings_of(storage, {key: reports[key] for key in unread})
    texts = ("key", "kind", "collision_type", "road_topology", "vehicle_trajectory")
    schema = pa.schema(
        [(name, pa.string()) for name in texts]
        + [(name, pa.float64()) for name in _POSITION]
        + [("vehicles", pa.int32())]
    )
    return pa.Table.from_pylist([_row(listing) for listing in listings.values()], schema=schema)


def state_names() -> pa.Table:
    """Return names of the states by ``STATE`` code."""
    import pyarrow as pa

    return pa.table({"code": pa.array(list(STATES), pa.int32()), "name": list(STATES.values())})


def crash_kinds() -> pa.Table:
    """Return the kinds of crash, and whether each can be judged."""
    import pyarrow as pa

    return pa.table(
        {"kind": [kind.value for kind in CrashKind], "judged": [kind in JUDGED_KINDS for kind in CrashKind]}
    )


def code_meanings() -> pa.Table:
    """Return the meanings of FARS codes in the warehouse's columns, without those for "unknown"."""
    import pyarrow as pa

    meanings = [
        {"element": table.element, "code": code, "meaning": meaning}
        for table in _CODES
        for code, meaning in table.meanings.items()
        if meaning and table.known(code) is not None
    ]
    return pa.Table.from_pylist(
        meanings, schema=pa.schema([("element", pa.string()), ("code", pa.int32()), ("meaning", pa.string())])
    )


def domain_terms() -> pa.Table:
    """Return the terms of the operational design domain by element and code."""
    import pyarrow as pa

    terms = [
        {"element": element, "code": str(code), "term": term.term}
        for element, by_code in ODD.items()
        for code, term in by_code.items()
    ]
    return pa.Table.from_pylist(terms)


def _row(listing: CrashListing) -> dict[str, Any]:
    try:
        position = dict(zip(_POSITION, reported_position(listing.latitude_deg, listing.longitude_deg), strict=True))
    except Rejection:
        position = {}
    return {
        "key": listing.key,
        "kind": listing.kind.value if listing.kind else None,
        "collision_type": listing.collision_type.value,
        "road_topology": listing.road_topology.value,
        "vehicle_trajectory": listing.vehicle_trajectory.value,
        "vehicles": listing.vehicles,
        **position,
    }
