"""One line on a crash, enough to choose it for a cohort: what every source can list without reading whole reports."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.crash.classes import (
    CollisionType,
    CrashKind,
    RoadTopology,
    VehicleTrajectory,
    collision_type,
    kind_of_codes,
    road_topology,
)
from trace_dag.crash.codes.elements import FUNC_SYS_OF_ROAD_FNC, MOTOR_VEHICLE_IN_TRANSPORT
from trace_dag.crash.completed_record import complete_record
from trace_dag.crash.crash_types import vehicle_trajectory
from trace_dag.crash.fars.rows import FarsRows
from trace_dag.crash.fields import Fields
from trace_dag.crash.keys import state_of
from trace_dag.crash.parse import case_of, open_report
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.sequence import known_by_events_alone


@dataclass(frozen=True, slots=True)
class CrashListing:
    """A crash as a source lists it. None means not reported; codes are FARS codes, unchanged.

    ``vehicles`` counts motor vehicles in transport (``VE_FORMS``); ``crash_types`` are the ``ACC_TYPE`` of the vehicles
    that collided, by number.
    """

    key: str
    case_year: int
    state_case: int | None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    county_code: int | None = None  # COUNTY
    city_code: int | None = None  # CITY
    county_name: str = ""
    city_name: str = ""
    route_code: int | None = None  # ROUTE
    function_class_code: int | None = None  # FUNC_SYS
    vehicles: int | None = None  # VE_FORMS, else as many as the report lists
    kind: CrashKind | None = None  # HARM_EV, VE_FORMS, SOE
    manner_of_collision_code: int | None = None  # MAN_COLL
    intersection_type_code: int | None = None  # TYP_INT
    junction_relation_code: int | None = None  # RELJCT2
    crash_types: tuple[int | None, ...] = ()  # ACC_TYPE
    register_state_code: int | None = None  # STATE, where no state case says it

    @property
    def state_code(self) -> int | None:
        """Return ``STATE``."""
        return self.register_state_code if self.state_case is None else state_of(self.state_case)

    @property
    def collision_type(self) -> CollisionType:
        """Return the coverage class of the manner of collision."""
        return collision_type(self.manner_of_collision_code)

    @property
    def road_topology(self) -> RoadTopology:
        """Return the coverage class of the intersection."""
        return road_topology(self.intersection_type_code, self.junction_relation_code)

    @property
    def vehicle_trajectory(self) -> VehicleTrajectory:
        """Return the coverage class of the vehicles' crash types."""
        return vehicle_trajectory(self.crash_types)


def list_record(record: CrashRecord) -> CrashListing:
    """Return the line of a crash from its record.

    >>> list_record(record).manner_of_collision_code  # MAN_COLL 6: angle
    6
    """
    return CrashListing(
        key=record.key,
        case_year=record.case_year,
        state_case=record.state_case,
        latitude_deg=record.latitude_deg,
        longitude_deg=record.longitude_deg,
        county_name=record.county_name,
        city_name=record.city_name,
        route_code=record.route_code,
        function_class_code=record.function_class_code,
        vehicles=record.moving_vehicles,
        kind=record.kind,
        manner_of_collision_code=record.manner_of_collision_code,
        intersection_type_code=record.intersection_type_code,
        junction_relation_code=record.junction_relation_code,
        crash_types=tuple(vehicle.crash_type_code for vehicle in record.vehicles),
        register_state_code=record.state_code,
    )


def list_report(data: bytes, *, name: str) -> CrashListing:
    """Return the line of a report in any of its forms.

    Raises :class:`trace_dag.common.errors.Rejection` for a report that cannot be read.

    >>> list_report(report_xml, name="crash_319003.xml").manner_of_collision_code  # MAN_COLL 6: angle
    6
    """
    report, _ = open_report(data, name=name, repair=True)
    if isinstance(report, CrashRecord):
        return list_record(complete_record(report))
    return list_rows(report, name=name)


def list_rows(report: FarsRows, *, name: str) -> CrashListing:
    """Return the line of a crash of FARS.

    Raises :class:`trace_dag.common.errors.Rejection` for a value that cannot be read.
    """
    fields = report.fields(name)
    year, case, key = case_of(fields)
    vehicles = list(fields.rows("vehicle"))
    collided = _colliding_numbers(fields)
    return CrashListing(
        key=key,
        case_year=year,
        state_case=case,
        latitude_deg=fields.decimal("LATITUDE"),
        longitude_deg=fields.decimal("LONGITUD", "LONGITUDE"),
        county_code=fields.integer("COUNTY"),
        city_code=fields.integer("CITY"),
        county_name=fields.text("COUNTYNAME"),
        city_name=fields.text("CITYNAME"),
        route_code=fields.integer("ROUTE"),
        function_class_code=fields.integer("FUNC_SYS") or FUNC_SYS_OF_ROAD_FNC.get(fields.integer("ROAD_FNC") or 0),
        vehicles=fields.integer("VE_FORMS") or len(vehicles) or None,
        kind=_kind(fields),
        manner_of_collision_code=fields.integer("MAN_COLL"),
        intersection_type_code=fields.integer("TYP_INT"),
        junction_relation_code=fields.integer("RELJCT2"),
        crash_types=tuple(
            vehicle.integer("ACC_TYPE")
            for vehicle in vehicles
            if not known_by_events_alone(vehicle) and (not collided or vehicle.integer("VEH_NO") in collided)
        ),
    )


def _kind(crash: Fields) -> CrashKind | None:
    """Return the kind of crash, as the record of the report would have it."""
    vehicles = list(crash.rows("vehicle"))
    own = [*vehicles, *crash.rows("parkwork")]
    rows = list(crash.rows("cevent"))
    for table in ("vevent", "vsoe"):
        rows = rows or [row for each in own for row in each.own_rows(table)]
    rows.sort(key=lambda row: row.integer("EVENTNUM") or 0)
    codes = [code for row in rows if (code := row.integer("SOE")) is not None]
    return kind_of_codes(crash.integer("HARM_EV"), crash.integer("VE_FORMS") or len(vehicles), codes)


def _colliding_numbers(crash: Fields) -> set[int | None]:
    for event in crash.rows("cevent"):
        if event.integer("SOE") == MOTOR_VEHICLE_IN_TRANSPORT:
            return {event.integer("VNUMBER1"), event.integer("VNUMBER2")}
    return set()
