"""Real CrashAPI reports turned into the tables of a FARS national release: the same facts in the other layout."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path

from lxml import etree

Table = list[dict[str, str]]

NESTED = {
    "Vehicles": "vehicle",
    "CEvents": "cevent",
    "ParkWorks": "parkwork",
    "PbTypes": "pbtype",
    "NPersons": "person",
    "NmPriors": "nmprior",
    "NmCrashes": "nmcrash",
    "SafetyEQs": "safetyeq",
    "Weathers": "weather",
}
OF_VEHICLE = {
    "Damages": "damage",
    "Maneuvers": "maneuver",
    "VEvents": "vevent",
    "Vsoes": "vsoe",
    "VinDeriveds": "vpicdecode",
    "Persons": "person",
    "Violations": "violatn",
    "DrierRFs": "driverrf",
}
PCRASH4 = {
    "Tracking": "1",
    "Skidding longitudinally rotation less than 30 degrees": "2",
    "Skidding laterally clockwise rotation": "3",
    "Skidding laterally counterclockwise rotation": "4",
    "Precrash stability unknown": "9",
}


def tables_of(reports: Iterable[bytes]) -> dict[str, Table]:
    """The national tables holding what the reports say."""
    tables: dict[str, Table] = {name: [] for name in ("accident", *NESTED.values(), *OF_VEHICLE.values())}
    for data in reports:
        crash = etree.fromstring(data).find(".//CrashResultSet")
        assert crash is not None
        row = _scalars(crash)
        case = row["ST_CASE"]
        row.pop("CASEYEAR")
        tables["accident"].append(row)
        for members, name in NESTED.items():
            for element in crash.iterfind(f"{members}/*"):
                entry = _scalars(element) | {"ST_CASE": case}
                if name == "vehicle":
                    label = " ".join(entry.get("PCRASH4NAME", "").split())
                    entry["PCRASH4"] = PCRASH4[label]
                    for inner, inner_name in OF_VEHICLE.items():
                        tables[inner_name] += [
                            _scalars(child) | {"ST_CASE": case, "VEH_NO": entry["VEH_NO"]}
                            for child in element.iterfind(f"{inner}/*")
                        ]
                tables[name].append(entry)
    return tables


def write(tables: dict[str, Table], folder: Path, *, encoding: str = "utf-8", upper: bool = False) -> None:
    """Write the tables as CSV files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in tables.items():
        if rows:
            (folder / (f"{name.upper()}.CSV" if upper else f"{name}.csv")).write_bytes(csv_of(rows).encode(encoding))


def csv_of(rows: Table) -> str:
    """Rows as CSV text, columns in the order in which they appear."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, columns, restval="")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def _scalars(element: etree._Element) -> dict[str, str]:
    return {child.tag.upper(): child.text or "" for child in element if len(child) == 0}
