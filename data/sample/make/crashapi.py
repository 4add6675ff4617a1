"""A report as the CrashAPI's ``GetCaseDetails`` serves it in XML."""

from __future__ import annotations

import datetime
from xml.sax.saxutils import escape

from make.elements import CRASH, PERSON, VEHICLE
from make.labels import CONFIGURATION_OF_TYPE, LABELS, MONTHS, WEEKDAYS, hour_label, label, travel_speed_label
from make.report import STATE, EventCodes, Report, VehicleCodes

STATE_NAME, STATE_INITIAL = "Nebraska", "NE"
COUNTY, COUNTY_NAME = 199, "LODESTAR (199)"
CITY, CITY_NAME = 9001, "MERROW"
_ROOT = (
    '<ResponseOfListOfCaseDetail xmlns:xsd="http://www.w3.org/2001/XMLSchema" '
    'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">'
)
Fields = list[tuple[str, object]]


class _Xml:
    """Lines of indented XML; every value is text, empty elements are self-closed."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.depth = 0

    def value(self, tag: str, value: object) -> None:
        text = escape(str(value))
        self.lines.append("    " * self.depth + (f"<{tag}>{text}</{tag}>" if text else f"<{tag} />"))

    def values(self, fields: Fields) -> None:
        for tag, value in fields:
            self.value(tag, value)

    def open(self, tag: str) -> None:
        self.lines.append("    " * self.depth + f"<{tag}>")
        self.depth += 1

    def close(self, tag: str) -> None:
        self.depth -= 1
        self.lines.append("    " * self.depth + f"</{tag}>")

    def record(self, tag: str, fields: Fields) -> None:
        self.open(tag)
        self.values(fields)
        self.close(tag)

    def lists(self, tag: str, item: str, records: list[Fields]) -> None:
        if not records:
            self.value(tag, "")
            return
        self.open(tag)
        for fields in records:
            self.record(item, fields)
        self.close(tag)


def not_released(number_of_case: int) -> bytes:
    """The answer for a case that is not out yet."""
    return (
        f"{_ROOT}\n    <Count>0</Count>\n    <Message>Results returned successfully</Message>\n"
        f"    <SearchCriteria>{_search(number_of_case)}</SearchCriteria>\n    <Results />\n"
        "</ResponseOfListOfCaseDetail>"
    ).encode()


def crashapi_xml(report: Report) -> bytes:
    """The answer for a case."""
    x = _Xml()
    x.depth = 1
    x.values([("Count", 1), ("Message", "Results returned successfully"), ("SearchCriteria", _search(report.case))])
    for tag in ("Results", "ArrayOfCaseDetail", "CaseDetail", "CrashResultSet"):
        x.open(tag)
    x.values(_filled(CRASH, _crash(report)))
    x.lists("CrashRFs", "CrashRF", [[*_head(report), ("CRASHRF", 0), ("CRASHRFNAME", "None Noted")]])
    weather = [("WEATHER", report.weather), ("WEATHERNAME", label("WEATHER", report.weather))]
    x.lists("Weathers", "Weather", [[*_head(report), *weather]])
    x.open("Vehicles")
    for vehicle in report.vehicles:
        _write_vehicle(x, report, vehicle)
    x.close("Vehicles")
    if report.standing:
        x.lists("ParkWorks", "ParkWork", [_standing(report, vehicle) for vehicle in report.standing])
    if report.people:
        _write_people(x, report)
    x.lists("CEvents", "CEvent", [_event(report, i, e) for i, e in enumerate(report.events, 1)])
    for tag in ("CrashResultSet", "CaseDetail", "ArrayOfCaseDetail", "Results"):
        x.close(tag)
    text = "\n".join([_ROOT, *x.lines, "</ResponseOfListOfCaseDetail>"])
    return (text.replace("&amp;", "&") if report.bare_ampersand else text).encode()


def _standing(report: Report, v: VehicleCodes) -> Fields:
    """A parked vehicle or one at work, its codes alone: labels change, codes are what is read."""
    month, day, hour, minute = report.when
    return [
        *(field for field in _head(report) if field[0] != "STATEINITIAL"), ("Veh_No", v.number),
        ("PVE_FORMS", len(report.vehicles)), ("PNUMOCCS", v.occupants), ("PDAY", day), ("PMONTH", month),
        ("PHOUR", hour), ("PMINUTE", minute), ("PHARM_EV", report.harmful), ("PMAN_COLL", report.manner),
        ("PTYPE", 4 if report.at_work else 2), ("PHIT_RUN", 0), ("PMAKE", v.body.make[0]),
        ("PMODEL", v.body.model[0]), ("PBODYTYP", v.body.body_type), ("PMODYEAR", _model_year(report, v)),
        ("PTRAILER", v.body.trailers), ("PIMPACT1", v.impact), ("PM_HARM", 12), ("PDEATHS", 0),
        ("PGVWR_FROM", _weight_class(v)["GVWR_FROM"]), ("PGVWR_TO", _weight_class(v)["GVWR_TO"]),
    ]  # fmt: skip


def _write_people(x: _Xml, report: Report) -> None:
    """The lists about persons outside the vehicles, their codes alone: labels change, codes are what is read."""
    typed, persons, acts = [], [], []
    for number, person in enumerate(report.people, 1):
        own: Fields = [f for f in _head(report, ("VEH_NO", 0), ("PER_NO", number)) if f[0] != "STATEINITIAL"]
        typed.append([*own, ("PBPTYPE", person.kind), ("PBAGE", person.age), ("PBSEX", person.sex), *person.typing])
        persons.append([
            *own, ("VE_FORMS", len(report.vehicles)), ("STR_VEH", person.struck_by), ("AGE", person.age),
            ("SEX", person.sex), ("PER_TYP", person.kind), ("INJ_SEV", 4), ("LOCATION", person.location),
        ])  # fmt: skip
        acts.append([*own, ("MPR_ACT", person.action), ("NMACTION", person.action)])
    x.lists("PbTypes", "PBType", typed)
    x.lists("NPersons", "Person", persons)
    x.lists("NmPriors", "NMPrior", acts)


def _search(case: int) -> str:
    return f"StateCase: {case} And CaseYear: 2023 And State: {STATE}"


def _filled(elements: dict[str, str | None], values: dict[str, object]) -> Fields:
    """Elements in the service's order; every one of ``values`` has a place, every gap has a value."""
    unknown = sorted(set(values) - set(elements))
    missing = sorted(tag for tag, default in elements.items() if default is None and tag not in values)
    if unknown or missing:
        raise ValueError(f"unknown elements {unknown}, elements without a value {missing}")
    return [(tag, values.get(tag, default)) for tag, default in elements.items()]


def _named(**codes: int) -> dict[str, object]:
    """Codes with their labels, but for ``PCRASH4``, which the service gives by label only."""
    out: dict[str, object] = {}
    for element, code in codes.items():
        if element != "PCRASH4":
            out[element] = code
        out[f"{element}NAME"] = label(element, code)
    return out


def _ids(report: Report) -> dict[str, object]:
    return {"CaseYear": 2023, "ST_CASE": report.case, "STATENAME": STATE_NAME}


def _head(report: Report, *more: tuple[str, object]) -> Fields:
    return [
        ("CaseYear", 2023), ("STATE", STATE), ("ST_CASE", report.case), ("STATENAME", STATE_NAME),
        ("STATEINITIAL", STATE_INITIAL), *more,
    ]  # fmt: skip


def _time(report: Report) -> dict[str, object]:
    month, day, hour, minute = report.when
    return {
        "DAY": day, "DAYNAME": day, "MONTH": month, "MonthName": MONTHS[month - 1], "HOUR": hour,
        "HOURNAME": hour_label(hour), "MINUTE": minute, "MINUTENAME": minute,
    }  # fmt: skip


def _crash(report: Report) -> dict[str, object]:
    month, day, *_ = report.when
    weekday = datetime.date(2023, month, day).isoweekday() % 7
    in_town = not report.rural
    people = sum(v.occupants for v in report.vehicles)
    return {
        **_ids(report), "State": STATE, "VE_TOTAL": len(report.vehicles) + len(report.standing),
        "VE_FORMS": len(report.vehicles),
        "PEDS": len(report.people), "PERNOTMVIT": len(report.people),
        "PERMVIT": people, "PERSONS": people, "COUNTY": COUNTY, "COUNTYNAME": COUNTY_NAME,
        "CITY": CITY if in_town else 0, "CITYNAME": CITY_NAME if in_town else "NOT APPLICABLE", **_time(report),
        "DAY_WEEK": weekday + 1, "DAY_WEEKNAME": WEEKDAYS[weekday],
        **_named(
            RUR_URB=1 if report.rural else 2, FUNC_SYS=report.functional_system, ROUTE=report.route,
            HARM_EV=report.harmful, MAN_COLL=report.manner, RELJCT1=report.interchange, RELJCT2=report.junction,
            TYP_INT=report.intersection, REL_ROAD=report.relation_to_road, LGT_COND=report.light,
            WEATHER=report.weather,
        ),
        "TWAY_ID": report.ways[0], "TWAY_ID2": report.ways[1],
        "LATITUDE": f"{report.latitude_deg:.8f}", "LATITUDENAME": _place_label(report.latitude_deg, 77.7777),
        "LONGITUD": f"{report.longitude_deg:.9f}", "LONGITUDNAME": _place_label(report.longitude_deg, 777.7777),
        "SCH_BUS": int(_school_bus(report)), "SCH_BUSNAME": "Yes" if _school_bus(report) else "No",
    }  # fmt: skip


def _place_label(degrees: float, not_reported: float) -> str:
    return "Not Reported" if degrees == not_reported else f"{degrees:.8f}"


def _school_bus(report: Report) -> bool:
    return any(v.body.body_type == 50 for v in report.vehicles)


def _write_vehicle(x: _Xml, report: Report, v: VehicleCodes) -> None:
    x.open("Vehicle")
    x.values(_filled(VEHICLE, _vehicle(report, v)))
    own: Fields = [*_head(report), ("VEH_NO", v.number)]
    plain: Fields = [f for f in own if f[0] != "STATEINITIAL"]
    x.open("Persons")
    x.open("Person")
    x.values(_filled(PERSON, _person(report, v)))
    person: Fields = [*own, ("PER_NO", 1)]
    x.lists("PersonRFs", "PersonRF", [[*person, ("PERSONRF", 0), ("PERSONRFNAME", "None Noted")]])
    x.value("Races", "")
    x.value("OCCDrugs", "")
    x.close("Person")
    x.close("Persons")
    x.lists("Damages", "Damage", [
        [*plain, ("MDAREAS", h), ("MDAREASNAME", label("DAMAGE", h)), ("DAMAGE", h), ("DAMAGENAME", label("DAMAGE", h))]
        for h in _damaged(report, v)
    ])  # fmt: skip
    for tag in ("VinDecodes", "VinDeriveds", "TrailerVinDeriveds"):
        x.value(tag, "")
    avoided = {1: 0, 16: 4}.get(v.avoidance, 98)
    x.lists("Maneuvers", "Maneuver", [[
        *plain, ("MDRMANAV", avoided), ("MDRMANAVNAME", label("MANEUVER", avoided)),
        ("MANEUVER", avoided), ("MANEUVERNAME", label("MANEUVER", avoided)),
    ]])  # fmt: skip
    x.lists("DrImpairs", "DrImpair", [[*plain, ("DRIMPAIR", 0), ("DRIMPAIRNAME", "None/Apparently Normal")]])
    x.lists("Distractions", "Distract", [[
        *plain, ("MDRDSTRD", 96), ("MDRDSTRDNAME", "Not Reported"), ("DRDISTRACT", 96),
        ("DRDISTRACTNAME", "Not Reported"),
    ]])  # fmt: skip
    x.lists("Violations", "Violation", [[
        *plain, ("MVIOLATN", v.charge), ("MVIOLATNNAME", LABELS["VIOLATION"][v.charge]), ("VIOLATION", v.charge),
        ("VIOLATIONNAME", LABELS["VIOLATION"][v.charge]),
    ]])  # fmt: skip
    own_events = [(i, e) for i, e in enumerate(report.events, 1) if v.number in (e.vehicle_1, e.vehicle_2)]
    x.lists("VEvents", "VEvent", [_own_event(report, v, i, n, e) for n, (i, e) in enumerate(own_events, 1)])
    x.lists("Vsoes", "VSOEs", [_sequence(report, v, n, e) for n, (_, e) in enumerate(own_events, 1)])
    x.lists("Factors", "Factor", [[
        *plain, ("MFACTOR", 0), ("MFACTORNAME", "None Noted"), ("VEHICLECC", 0), ("VEHICLECCNAME", "None Noted"),
    ]])  # fmt: skip
    x.lists("Visions", "Vision", [[
        *plain, ("MVISOBSC", 0), ("MVISOBSCNAME", "No Obstruction Noted"), ("VISION", 0),
        ("VISIONNAME", "No Obstruction Noted"),
    ]])  # fmt: skip
    x.lists("VehicleSFs", "VehicleSF", [[*own, ("VEHICLESF", 0), ("VEHICLESFNAME", "None Noted")]])
    x.lists("DrierRFs", "DriverRF", [[*own, ("DRIVERRF", 0), ("DRIVERRFNAME", "None Noted")]])  # the service's spelling
    x.close("Vehicle")


def _vehicle(report: Report, v: VehicleCodes) -> dict[str, object]:
    body = v.body
    make, model = body.make, body.model
    over = v.travel_speed < 998 and v.travel_speed > v.speed_limit + 5 and v.trafficway != 0
    limit = "No Statutory Limit/Non-Trafficway or Driveway Access" if v.speed_limit == 0 else f"{v.speed_limit} MPH"
    return {
        **_ids(report), "STATE": STATE, "VEH_NO": v.number, "VE_FORMS": len(report.vehicles), **_time(report),
        **_make(v), "MODEL": model[0], "MODELNAME": model[1], "MOD_YEAR": _model_year(report, v),
        "MOD_YEARNAME": _model_year(report, v), **_weight_class(v), "VPICMAKENAME": make[1],
        "BUS_USE": 1 if body.body_type in (50, 52) else 0,
        "BUS_USENAME": {50: "School", 52: "Transit/Commuter"}.get(body.body_type, "Not a Bus"),
        "TRAV_SP": v.travel_speed, "TRAV_SPNAME": travel_speed_label(v.travel_speed),
        "VSPD_LIM": v.speed_limit, "VSPD_LIMNAME": limit,
        "DEFORMED": 6 if v.deaths or body.kind in ("car", "motorcycle") else 4,
        "DEFORMEDNAME": "Disabling Damage" if v.deaths or body.kind in ("car", "motorcycle") else "Functional Damage",
        "DEATHS": v.deaths, **_rollover(v), **_trailer(v),
        **_named(
            HARM_EV=report.harmful, MAN_COLL=report.manner, IMPACT1=v.impact, SPEEDREL=3 if over else 0,
            VTRAFWAY=v.trafficway, VNUM_LAN=v.lanes, VALIGN=v.alignment, VSURCOND=v.surface, VTRAFCON=v.control,
            VTCONT_F=3 if v.control else 0, P_CRASH1=v.movement, P_CRASH2=v.event, P_CRASH3=v.avoidance,
            PCRASH4=v.stability, PCRASH5=v.location, ACC_TYPE=v.crash_type,
            ACC_CONFIG=CONFIGURATION_OF_TYPE[v.crash_type],
        ),
    }  # fmt: skip


def _make(v: VehicleCodes) -> dict[str, object]:
    make, model = v.body.make, v.body.model
    return {
        "MAKE": make[0], "MAKENAME": make[1], "MAK_MOD": f"{make[0]}{model[0]:03d}",
        "MAK_MODNAME": f"{make[1]} {model[1]}", **_named(BODY_TYP=v.body.body_type),
    }  # fmt: skip


def _model_year(report: Report, v: VehicleCodes) -> int:
    return 2003 + (report.number * 7 + v.number * 5) % 20


def _trailer(v: VehicleCodes) -> dict[str, object]:
    pulled = v.body.trailers > 0
    truck = {62: (1, "Single-Unit Truck (2- axle and GVWR more than 10,000 lbs)", 1, "Van/Enclosed Box"),
             63: (2, "Single-Unit Truck (3 or more axles)", 4, "Dump"),
             66: (6, "Truck Tractor/Semi-Trailer", 1, "Van/Enclosed Box")}  # fmt: skip
    bus = (21, "Bus (seats for more than 15 occupants, including driver)", 22, "Bus")
    none = (0, "Not Applicable", 0, "Not Applicable (N/A)")
    code = v.body.body_type
    configuration = bus if code in (50, 52) else truck.get(code, none)
    return {
        "TOW_VEH": int(pulled), "TOW_VEHNAME": "One Trailer" if pulled else "No Trailers",
        "J_KNIFE": int(pulled), "J_KNIFENAME": "No" if pulled else "Not an Articulated Vehicle",
        "V_CONFIG": configuration[0], "V_CONFIGNAME": configuration[1], "CARGO_BT": configuration[2],
        "CARGO_BTNAME": configuration[3],
        "TRLR1VIN": "999999999999" if pulled else "777777777777",
        "TRLR1VINNAME": "Reported as Unknown" if pulled else "No Trailing Units",
        "TRLR1GVWR": 99 if pulled else 77, "TRLR1GVWRNAME": "Reported as Unknown" if pulled else "No Trailing Units",
    }  # fmt: skip


def _weight_class(v: VehicleCodes) -> dict[str, object]:
    classes = {
        62: (16, "Class 6: 19,501 - 26,000 lbs. (8,845 - 11,794 kg)"),
        50: (17, "Class 7: 26,001 - 33,000 lbs. (11,794 - 14,969 kg)"),
        **dict.fromkeys((52, 63, 66), (18, "Class 8: 33,001 lbs. and above (14,969 kg and above)")),
        **dict.fromkeys((15, 34), (12, "Class 2: 6,001 - 10,000 lbs. (2,722 - 4,536 kg)")),
    }
    code, text = classes.get(v.body.body_type, (11, "Class 1: 6,000 lbs. or less (2,722 kg or less)"))
    return {"GVWR_FROM": code, "GVWR_FROMNAME": text, "GVWR_TO": code, "GVWR_TONAME": text}


def _rollover(v: VehicleCodes) -> dict[str, object]:
    code, text = (8, "Not Applicable") if v.body.kind == "motorcycle" else (0, "No Rollover")
    return {"ROLLOVER": code, "ROLLOVERNAME": text, "ROLINLOC": code, "ROLINLOCNAME": text}


def _person(report: Report, v: VehicleCodes) -> dict[str, object]:
    month, day, hour, minute = report.when
    rider = v.body.kind == "motorcycle"
    values: dict[str, object] = {
        **_ids(report), "STATE": STATE, "VEH_NO": v.number, "VE_FORMS": len(report.vehicles), "COUNTY": COUNTY,
        "COUNTYNAME": COUNTY_NAME, **_time(report), **_make(v), **_weight_class(v), "VPICMAKENAME": v.body.make[1],
        "MOD_YEAR": _model_year(report, v), "MOD_YEARNAME": _model_year(report, v),
        **{k: w for k, w in _trailer(v).items() if k.startswith("TOW_VEH")},
        **{k: w for k, w in _rollover(v).items() if k.startswith("ROLLOVER")},
        "SCH_BUS": int(_school_bus(report)), "SCH_BUSNAME": "Yes" if _school_bus(report) else "No",
        **_named(RUR_URB=1 if report.rural else 2, FUNC_SYS=report.functional_system, HARM_EV=report.harmful,
                 MAN_COLL=report.manner, IMPACT1=v.impact),
        "AGE": v.driver_age, "AGENAME": f"{v.driver_age} Years", "SEX": v.driver_sex,
        "SEXNAME": "Male" if v.driver_sex == 1 else "Female",
        "AIR_BAG": 20 if rider else 1, "AIR_BAGNAME": "Not Deployed" if rider else "Deployed- Front",
        "EJECTION": 8 if rider else 0, "EJECTIONNAME": "Not Applicable" if rider else "Not Ejected",
        "HELM_USE": 5 if rider else 20,
        "HELM_USENAME": "DOT-Compliant Motorcycle Helmet" if rider else "Not Applicable",
        "HELM_MIS": 0 if rider else 7,
        "HELM_MISNAME": "No Indication of Misuse" if rider else "None Used/Not Applicable",
    }  # fmt: skip
    if v.deaths:
        later = minute + 9
        death_hour, death_minute = (hour + later // 60) % 24, later % 60
        return values | {
            "INJ_SEV": 4, "INJ_SEVNAME": "Fatal Injury (K)", "HOSPITAL": 0,
            "HOSPITALNAME": "Not Transported for Treatment", "DOA": 7, "DOANAME": "Died at Scene",
            "DEATH_DA": day, "DEATH_DANAME": day, "DEATH_MO": month, "DEATH_MONAME": MONTHS[month - 1],
            "DEATH_YR": 2023, "DEATH_YRNAME": 2023, "DEATH_HR": death_hour,
            "DEATH_HRNAME": f"{death_hour}:00-{death_hour}:59", "DEATH_MN": death_minute, "DEATH_MNNAME": death_minute,
            "DEATH_TM": death_hour * 100 + death_minute, "DEATH_TMNAME": death_hour * 100 + death_minute,
            "LAG_HRS": 0, "LAG_HRSNAME": 0, "LAG_MINS": 9, "LAG_MINSNAME": 9,
        }  # fmt: skip
    not_fatal = "Not Applicable (Non-Fatal)"
    return values | {
        "INJ_SEV": 2, "INJ_SEVNAME": "Suspected Minor Injury (B)", "HOSPITAL": 5, "HOSPITALNAME": "EMS Ground",
        "DOA": 0, "DOANAME": "Not Applicable", "DEATH_DA": 88, "DEATH_DANAME": not_fatal, "DEATH_MO": 88,
        "DEATH_MONAME": not_fatal, "DEATH_YR": 8888, "DEATH_YRNAME": not_fatal, "DEATH_HR": 88,
        "DEATH_HRNAME": not_fatal, "DEATH_MN": 88, "DEATH_MNNAME": not_fatal, "DEATH_TM": 8888,
        "DEATH_TMNAME": not_fatal, "LAG_HRS": 999, "LAG_HRSNAME": "Unknown", "LAG_MINS": 99, "LAG_MINSNAME": "Unknown",
    }  # fmt: skip


def _damaged(report: Report, v: VehicleCodes) -> list[int]:
    """Damaged areas: around each area this vehicle was struck at."""
    struck = {e.area_1 for e in report.events if e.vehicle_1 == v.number and e.area_1 <= 12}
    struck |= {e.area_2 for e in report.events if e.vehicle_2 == v.number and e.area_2 <= 12}
    reach = (-1, 0, 1) if v.deaths or v.body.kind in ("car", "motorcycle") else (0,)
    return sorted({(h + d) % 12 or 12 for h in struck for d in reach})


def _event(report: Report, number: int, e: EventCodes) -> Fields:
    plain: Fields = [f for f in _head(report) if f[0] != "STATEINITIAL"]
    return [*plain, ("EVENTNUM", number), *_areas(e), ("VNUMBER1", e.vehicle_1), *_other(e)]


def _areas(e: EventCodes) -> Fields:
    return [
        ("AOI1", e.area_1), ("AOI1NAME", label("AOI", e.area_1)), ("AOI2", e.area_2),
        ("AOI2NAME", label("AOI", e.area_2)), ("SOE", e.code), ("SOENAME", label("SOE", e.code)),
    ]  # fmt: skip


def _other(e: EventCodes) -> Fields:
    names = {5555: "Non-Harmful Event", 9999: "Not a Motor Vehicle"}
    return [("VNUMBER2", e.vehicle_2), ("VNUMBER2NAME", names.get(e.vehicle_2, e.vehicle_2))]


def _own_event(report: Report, v: VehicleCodes, number: int, own_number: int, e: EventCodes) -> Fields:
    """A vehicle's view of an event: itself first."""
    own = e if e.vehicle_1 == v.number else EventCodes(e.code, e.vehicle_2, e.area_2, e.vehicle_1, e.area_1)
    return [
        ("STATE", STATE), ("EVENTNUM", number), ("VEH_NO", v.number), ("VEVENTNUM", own_number),
        ("AOI1", own.area_1), ("AOI1NAME", label("AOI", own.area_1)), ("SOE", own.code),
        ("SOENAME", label("SOE", own.code)), ("AOI2", own.area_2), ("AOI2NAME", label("AOI", own.area_2)),
        ("CaseYear", 2023), ("ST_CASE", report.case), ("STATENAME", STATE_NAME), ("VNUMBER1", own.vehicle_1),
        *_other(own),
    ]  # fmt: skip


def _sequence(report: Report, v: VehicleCodes, own_number: int, e: EventCodes) -> Fields:
    area = e.area_1 if e.vehicle_1 == v.number else e.area_2
    return [
        ("CASEYEAR", 2023), ("STATE", STATE), ("STATENAME", STATE_NAME), ("ST_CASE", report.case),
        ("VEH_NO", v.number), ("VEVENTNUM", own_number), ("SOE", e.code), ("SOENAME", LABELS["SOE"][e.code]),
        ("AOI", area), ("AOINAME", label("AOI", area)),
    ]  # fmt: skip
