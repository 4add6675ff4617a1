"""Rows of an answer as files that other tools open: Excel, GeoJSON, Parquet."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trace_dag.errors import UserError

if TYPE_CHECKING:
    import pandas as pd

_LATITUDE, _LONGITUDE = "latitude_deg", "longitude_deg"


def write_rows(path: Path, output: str, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write rows into a file of one of :data:`FORMATS`; :class:`UserError` for rows that cannot be written so."""
    FORMATS[output](path, names, rows)


def _frame(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame([list(row) for row in rows], columns=list(names))


def _write_excel(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """One sheet. What a report says stays text: Excel would take "=..." for a formula and "http..." for a link."""
    import pandas as pd

    options = {"strings_to_formulas": False, "strings_to_urls": False}
    with pd.ExcelWriter(path, engine="xlsxwriter", engine_kwargs={"options": options}) as writer:
        _frame(names, [[_cell(value) for value in row] for row in rows]).to_excel(
            writer, sheet_name="trace-dag", index=False
        )


def _cell(value: object) -> object:
    """Lists and structures as JSON: a cell holds one thing."""
    return json.dumps(value, default=str) if isinstance(value, list | dict | tuple) else value


def _write_geojson(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A point for each row (RFC 7946: WGS84, longitude first); rows without a position have no geometry."""
    if _LATITUDE not in names or _LONGITUDE not in names:
        raise UserError(f"sql: GeoJSON needs the columns {_LATITUDE} and {_LONGITUDE} among the rows")
    features = []
    for row in rows:
        properties = dict(zip(names, row, strict=True))
        place = properties.pop(_LONGITUDE), properties.pop(_LATITUDE)
        point = None if None in place else {"type": "Point", "coordinates": place}
        features.append({"type": "Feature", "geometry": point, "properties": properties})
    collection = {"type": "FeatureCollection", "features": features}
    path.write_text(json.dumps(collection, ensure_ascii=False, default=str), encoding="utf-8")


def _write_parquet(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    _frame(names, rows).to_parquet(path, index=False)


FORMATS: dict[str, Callable[[Path, Sequence[str], Sequence[Sequence[Any]]], None]] = {
    "xlsx": _write_excel,
    "geojson": _write_geojson,
    "parquet": _write_parquet,
}
"""What writes a file of each format."""
