"""The stored crash record: a Parquet file of one row, with vehicles, events and non-motorists as lists of structs.

Every column is declared once, here: name with its unit, type, meaning and the FARS element it comes from. The schema of
the files, the conversion both ways and the data dictionary follow from it. All files have the same schema, so that
DuckDB and pandas read those of a root as one table (``read_parquet('crash_record/*.parquet')``).
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.errors import Failure
from trace_dag.common.json_adapters import json_adapter
from trace_dag.common.schemas import Column, ColumnType, TableSchema, table_from_parquet
from trace_dag.crash.record import CrashRecord

if TYPE_CHECKING:
    import pyarrow as pa

SCHEMA_VERSION: Final = 4
"""Version of :data:`CRASH_RECORD`, in every file: raised when a column comes, goes or changes its meaning."""
_INTEGER, _REAL, _TEXT, _BOOLEAN = ColumnType.INTEGER, ColumnType.REAL, ColumnType.TEXT, ColumnType.BOOLEAN

_AREA_FIELDS: Final = (
    Column("code", _INTEGER, "FARS code of the area", source="IMPACT1, AOI", required=True),
    Column("clock_h", _REAL, "Clock position on the body: 12 front, 3 right", "h", required=True),
    Column("centre_rad", _REAL, "Its direction from the front, counter-clockwise", "rad", required=True),
    Column("half_width_rad", _REAL, "Half of the interval it covers", "rad", required=True),
)


def _area(name: str, meaning: str, source: str) -> Column:
    return Column(name, None, meaning, source=source, fields=_AREA_FIELDS)


_HEADING_FIELDS: Final = (
    Column("octant", _TEXT, "Direction of the compass", required=True),
    Column("moment", _TEXT, "Of one that turned: before it did, after, or unknown", required=True),
)
_OCCUPANT_FIELDS: Final = (
    Column("number", _INTEGER, "Number of the person in the vehicle", source="PER_NO", required=True),
    Column("role_code", _INTEGER, "Driver or passenger", source="PER_TYP", required=True),
    Column("injury_code", _INTEGER, "How badly the person was hurt", source="INJ_SEV"),
    Column("age_years", _INTEGER, "Age", "a", "AGE"),
    Column("restraint_code", _INTEGER, "Belt or other restraint", source="REST_USE"),
)
_QUOTATION_FIELDS: Final = (
    Column("of", _TEXT, "The crash, or the vehicle, person or event by its number", required=True),
    Column("field", _TEXT, "Its field", required=True),
    Column("words", _TEXT, "Words of the narrative, as they stand there", required=True),
)
_TRAILER_FIELDS: Final = (
    Column("length_m", _REAL, "Length without a drawbar", "m", required=True),
    Column("width_m", _REAL, "Width", "m", required=True),
    Column("height_m", _REAL, "Height", "m", required=True),
    Column("mass_kg", _REAL, "Mass with its load", "kg", "TRLR1GVWR", required=True),
    Column("coupling_m", _REAL, "Coupling behind its front, negative ahead of it", "m", required=True),
    Column("axle_m", _REAL, "Middle of its axles behind its front", "m", required=True),
    Column("cg_m", _REAL, "Centre of gravity behind its front", "m", required=True),
    Column("hitch_m", _REAL, "Hitch behind the front of the vehicle that pulls", "m", required=True),
)

VEHICLE_COLUMNS: Final = (
    Column("number", _INTEGER, "Number of the vehicle in the crash", source="VEH_NO", required=True),
    Column("vehicle_class", _TEXT, "Kind of body to simulate", source="BODY_TYP, VPICBODYCLASS, MODEL", required=True),
    Column("length_m", _REAL, "Length of the body, without a trailer", "m", required=True),
    Column("width_m", _REAL, "Width of the body", "m", required=True),
    Column("height_m", _REAL, "Height of the body", "m", required=True),
    Column("mass_kg", _REAL, "Mass in running order, without a trailer", "kg", "GVWR, vPIC curb weight", required=True),
    Column("body_type_code", _INTEGER, "Body type", source="BODY_TYP"),
    Column("make_model", _TEXT, "Make and model as labelled", source="MAK_MODNAME"),
    Column("model_year", _INTEGER, "Model year", "a", "MOD_YEAR"),
    Column("trailers", _INTEGER, "Trailing units", source="TOW_VEH"),
    Column("trailer", None, "What it pulls, as one body", source="TOW_VEH, BODY_TYP", fields=_TRAILER_FIELDS),
    Column("jackknife_code", _INTEGER, "Jackknifed, in the first or a later event", source="J_KNIFE"),
    Column("in_transport", _BOOLEAN, "In transport, not parked or at work", source="UNITTYPE", required=True),
    Column("travel_speed_mps", _REAL, "Reported speed before the crash", "m/s", "TRAV_SP"),
    Column("travel_speed_is_lower_bound", _BOOLEAN, "The speed was higher than can be coded", source="TRAV_SP"),
    Column("speed_limit_mps", _REAL, "Speed limit", "m/s", "VSPD_LIM"),
    Column("speeding", _BOOLEAN, "Speeding as reported", source="SPEEDREL"),
    Column("driver_drinking", _BOOLEAN, "The driver had been drinking, as reported", source="DR_DRINK"),
    Column("driver_age_years", _INTEGER, "Age of the driver", "a", "AGE"),
    Column("driver_belted", _BOOLEAN, "The driver wore a belt, as reported", source="REST_USE"),
    Column("occupants_killed", _INTEGER, "Occupants that were killed", source="DEATHS"),
    Column("lanes", _INTEGER, "Lanes of the roadway", source="VNUM_LAN"),
    Column("trafficway_code", _INTEGER, "Trafficway description", source="VTRAFWAY"),
    Column("alignment_code", _INTEGER, "Alignment: straight or curving", source="VALIGN"),
    Column("profile_code", _INTEGER, "Grade", source="VPROFILE"),
    Column("surface_condition_code", _INTEGER, "Condition of the surface", source="VSURCOND"),
    Column("traffic_control_code", _INTEGER, "Traffic control device", source="VTRAFCON"),
    Column("disobeyed_control", _BOOLEAN, "Its driver disobeyed it, as charged or noted", source="VIOLATION, DRIVERRF"),
    Column("movement", _INTEGER, "Movement before the critical event", source="P_CRASH1", required=True),
    Column("critical_event_code", _INTEGER, "What made the crash imminent", source="P_CRASH2"),
    Column("avoidance_code", _INTEGER, "Attempted avoidance", source="P_CRASH3"),
    Column("stability_code", _INTEGER, "Stability before the impact", source="PCRASH4"),
    Column("location_code", _INTEGER, "Location before the impact", source="PCRASH5"),
    Column("crash_type_code", _INTEGER, "Crash type of the vehicle", source="ACC_TYPE"),
    _area("impact", "Area struck in the collision", "IMPACT1, AOI1, AOI2"),
    Column("initial_impact_code", _INTEGER, "Area of the first impact, as reported", source="IMPACT1"),
    Column("damaged_areas", _INTEGER, "Damaged areas", source="MDAREAS, DAMAGE", repeated=True),
    Column("avoidance_manoeuvres", _INTEGER, "What the driver avoided", source="MDRMANAV, MANEUVER", repeated=True),
    Column("rollover_code", _INTEGER, "Rollover", source="ROLLOVER"),
    Column("hit_and_run", _BOOLEAN, "Left the scene", source="HIT_RUN"),
    Column("keeps_left", _BOOLEAN, "Traffic keeps left, where it drove", required=True),
    Column("heading", None, "Reported direction of travel, of registers other than FARS", fields=_HEADING_FIELDS),
    Column("occupants", None, "The persons in the vehicle", repeated=True, fields=_OCCUPANT_FIELDS),
    Column("implied", _TEXT, "Fields derived from others", repeated=True),
)

EVENT_COLUMNS: Final = (
    Column("number", _INTEGER, "Number in the crash's sequence", source="EVENTNUM", required=True),
    Column("code", _INTEGER, "What happened", source="SOE", required=True),
    Column("party_1", _INTEGER, "First party", source="VNUMBER1"),
    _area("area_1", "Area struck on the first party", "AOI1"),
    Column(
        "party_2", _INTEGER, "Second party: a vehicle, 1000 + a person, 2000 + an event", source="VNUMBER2, STR_VEH"
    ),
    _area("area_2", "Area struck on the second party", "AOI2"),
    Column("implied", _TEXT, "Fields derived from others", repeated=True),
    Column("kind", _TEXT, "Kind of event", source="SOE", required=True),
)

NON_MOTORIST_COLUMNS: Final = (
    Column("number", _INTEGER, "Number of the person", source="PER_NO", required=True),
    Column("person_type_code", _INTEGER, "Kind of person", source="PER_TYP, PBPTYPE", required=True),
    Column("striking_vehicle", _INTEGER, "Number of the vehicle that struck the person", source="STR_VEH"),
    Column("age_years", _INTEGER, "Age", "a", "AGE, PBAGE"),
    Column("sex_code", _INTEGER, "Sex", source="SEX, PBSEX"),
    Column("location_code", _INTEGER, "Where the person was", source="LOCATION"),
    Column("crosswalk_code", _INTEGER, "Marked crosswalk present", source="PBCWALK"),
    Column("sidewalk_code", _INTEGER, "Sidewalk present", source="PBSWALK"),
    Column("school_zone_code", _INTEGER, "In a school zone", source="PBSZONE"),
    Column("intersection_code", _INTEGER, "At an intersection", source="PEDLOC, BIKELOC"),
    Column("pedestrian_position_code", _INTEGER, "Position of a pedestrian when struck", source="PEDPOS"),
    Column("cyclist_position_code", _INTEGER, "Position of a cyclist when struck", source="BIKEPOS"),
    Column("pedestrian_direction_code", _INTEGER, "Direction of a pedestrian at an intersection", source="PEDDIR"),
    Column("cyclist_direction_code", _INTEGER, "Direction of a cyclist, with or against traffic", source="BIKEDIR"),
    Column("motorist_direction_code", _INTEGER, "Direction of the motorist at an intersection", source="MOTDIR"),
    Column("motorist_manoeuvre_code", _INTEGER, "Manoeuvre of the motorist at an intersection", source="MOTMAN"),
    Column("intersection_leg_code", _INTEGER, "Near or far side of the intersection", source="PEDLEG"),
    Column("scenario", _TEXT, "Scenario at an intersection: manoeuvre, side, crosswalk, direction", source="PEDSNR"),
    Column("pedestrian_group_code", _INTEGER, "Group of pedestrian crashes", source="PEDCGP"),
    Column("cyclist_group_code", _INTEGER, "Group of cyclist crashes", source="BIKECGP"),
    Column("pedestrian_type_code", _INTEGER, "Type of pedestrian crash", source="PEDCTYPE"),
    Column("cyclist_type_code", _INTEGER, "Type of cyclist crash", source="BIKECTYPE"),
    Column("actions", _INTEGER, "What the person did before the crash", source="NMACTION, MPR_ACT", repeated=True),
    Column("circumstances", _INTEGER, "What the person contributed", source="NMCC, MTM_CRSH", repeated=True),
    Column("equipment", _INTEGER, "Safety equipment, until 2018", source="MSAFEQMT", repeated=True),
    Column("helmet_code", _INTEGER, "Helmet used", source="NMHELMET"),
    Column("pads_code", _INTEGER, "Protective pads used", source="NMPROPAD"),
    Column("other_protection_code", _INTEGER, "Other protective equipment used", source="NMOTHPRO"),
    Column("reflective_clothing_code", _INTEGER, "Reflective clothing used", source="NMREFCLO"),
    Column("lights_code", _INTEGER, "Lights used", source="NMLIGHT"),
    Column("other_prevention_code", _INTEGER, "Other preventive equipment used", source="NMOTHPRE"),
    Column("injury_code", _INTEGER, "How badly the person was hurt", source="INJ_SEV"),
    Column("heading", None, "Reported direction of travel, of registers other than FARS", fields=_HEADING_FIELDS),
    Column("party", _INTEGER, "Number as a party, 1000 + its number", source="PER_NO", required=True),
    Column("kind", _TEXT, "Kind of party", source="PER_TYP, PBPTYPE", required=True),
)

CRASH_RECORD: Final = TableSchema(
    "crash_record",
    "One crash as read from its report",
    (
        Column("key", _TEXT, "Key of the crash, <caseYear>-<stateCase> or <register>-<id>", required=True),
        Column("case_year", _INTEGER, "Year of the case file", "a", "CaseYear, YEAR", required=True),
        Column("state_case", _INTEGER, "Case number of FARS, unique in its year", source="ST_CASE"),
        Column("latitude_deg", _REAL, "Reported latitude, WGS84", "deg", "LATITUDE", required=True),
        Column("longitude_deg", _REAL, "Reported longitude, WGS84", "deg", "LONGITUD", required=True),
        Column("vehicles", None, "The motor vehicles", required=True, repeated=True, fields=VEHICLE_COLUMNS),
        Column("events", None, "The sequence of events", source="CEvent", repeated=True, fields=EVENT_COLUMNS),
        Column("collision_type", _TEXT, "Coverage class of the manner of collision", source="MAN_COLL", required=True),
        Column("road_topology", _TEXT, "Coverage class of the intersection", source="TYP_INT", required=True),
        Column("vehicle_trajectory", _TEXT, "Coverage class of the crash type", source="ACC_TYPE", required=True),
        Column("register", _TEXT, "The register the crash is of: fars, or the name of another", required=True),
        Column("register_lacks", _TEXT, "Fields that the register has of no crash", repeated=True),
        Column("position_accuracy_m", _REAL, "How far reported points usually are from the crash", "m"),
        Column("attribution", _TEXT, "Whom a report of another register than FARS is to be attributed to"),
        Column("state_code", _INTEGER, "State", source="STATE"),
        Column("state_name", _TEXT, "Name of the state", source="STATE"),
        Column("county_name", _TEXT, "County as labelled", source="COUNTYNAME"),
        Column("city_name", _TEXT, "City as labelled", source="CITYNAME"),
        Column("year", _INTEGER, "Year of the crash", "a", "YEAR"),
        Column("month", _INTEGER, "Month of the crash", source="MONTH"),
        Column("day", _INTEGER, "Day of the crash", source="DAY"),
        Column("hour", _INTEGER, "Hour of the crash, local time", "h", "HOUR"),
        Column("minute", _INTEGER, "Minute of the crash", "min", "MINUTE"),
        Column("trafficway_1", _TEXT, "Road of the crash", source="TWAY_ID"),
        Column("trafficway_2", _TEXT, "Crossing road", source="TWAY_ID2"),
        Column("route_code", _INTEGER, "Route signing", source="ROUTE"),
        Column("function_class_code", _INTEGER, "Functional class of the road", source="FUNC_SYS, ROAD_FNC"),
        Column("rural_urban_code", _INTEGER, "Land use", source="RUR_URB, ROAD_FNC"),
        Column("manner_of_collision_code", _INTEGER, "Manner of collision, as reported", source="MAN_COLL"),
        Column("first_harmful_event_code", _INTEGER, "First harmful event", source="HARM_EV"),
        Column("intersection_type_code", _INTEGER, "Type of intersection, as reported", source="TYP_INT"),
        Column("junction_relation_code", _INTEGER, "Relation to a junction", source="RELJCT2"),
        Column("road_relation_code", _INTEGER, "Relation to the trafficway", source="REL_ROAD"),
        Column("light_code", _INTEGER, "Light", source="LGT_COND"),
        Column("weather_code", _INTEGER, "Weather", source="WEATHER"),
        Column("fatalities", _INTEGER, "Persons killed", source="FATALS"),
        Column("injury_code", _INTEGER, "How badly who was hurt worst was, as reported of the crash", source="INJ_SEV"),
        Column("vehicles_in_transport", _INTEGER, "Motor vehicles in transport, as stated", source="VE_FORMS"),
        Column("people_outside", _INTEGER, "People in no motor vehicle in transport, as stated", source="PEDS"),
        Column("non_motorists", None, "Persons outside motor vehicles", repeated=True, fields=NON_MOTORIST_COLUMNS),
        Column("implied", _TEXT, "Fields of the crash derived from others", repeated=True),
        Column("contradictions", _TEXT, "Fields that disagree, as sentences", repeated=True),
        Column("ambiguities", _TEXT, "What events and persons leave open, as sentences", repeated=True),
        Column("quotations", None, "Words that fields were read from", repeated=True, fields=_QUOTATION_FIELDS),
        Column("repaired", _BOOLEAN, "The report was not well-formed and was repaired", required=True),
        Column("summary", _TEXT, "The crash in words"),
        Column("kind", _TEXT, "Kind of crash", source="HARM_EV, VE_FORMS, SOE", required=True),
        Column("severity", _TEXT, "How badly anybody was hurt: K, A, B, C or O", source="INJ_SEV, FATALS"),
        Column("schema_version", _INTEGER, "Version of these columns", required=True),
    ),
)


def record_to_parquet(record: CrashRecord) -> bytes:
    """Return the record as a Parquet file of one row with the columns of :data:`CRASH_RECORD`.

    >>> record_to_parquet(record)[:4]
    b'PAR1'
    """
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    # Of a single row the statistics and a second copy of the schema would be most of the file.
    pq.write_table(records_table([record]), buffer, store_schema=False, write_statistics=False)
    return buffer.getvalue()


def records_table(records: Iterable[CrashRecord]) -> pa.Table:
    """Return some records as one table with the columns of :data:`CRASH_RECORD`.

    >>> records_table([record]).column("fatalities").to_pylist()
    [1]
    """
    import pyarrow as pa

    return pa.Table.from_pylist([_row(each) for each in records], schema=CRASH_RECORD.arrow())


def _row(record: CrashRecord) -> dict[str, Any]:
    """Return the fields of a record, with derived values for readers of the table."""
    row: dict[str, Any] = json_adapter(CrashRecord).dump_python(record, mode="json")
    events = [{**stored, "kind": event.kind.value} for stored, event in zip(row["events"], record.events, strict=True)]
    persons = [
        {**stored, "party": person.party, "kind": person.kind.value}
        for stored, person in zip(row["non_motorists"], record.non_motorists, strict=True)
    ]
    severity = record.severity
    derived = {
        "schema_version": SCHEMA_VERSION,
        "kind": record.kind.value,
        "severity": None if severity is None else severity.value,
    }
    return {**row, **derived, "events": events, "non_motorists": persons}


def record_from_parquet(data: bytes) -> CrashRecord:
    """Return the record in a Parquet file.

    Raises :class:`Failure` if the file is damaged or has another schema.
    """
    import pyarrow as pa

    try:
        (row,) = table_from_parquet(data).to_pylist()
        if row["schema_version"] != SCHEMA_VERSION:
            raise ValueError(f"it has schema version {row['schema_version']}, expected {SCHEMA_VERSION}")
        return json_adapter(CrashRecord).validate_python(row)
    except (pa.ArrowException, KeyError, ValueError, OSError) as error:
        raise Failure(
            f"a stored crash record cannot be read ({error}): remove it and run crash_record again"
        ) from error
