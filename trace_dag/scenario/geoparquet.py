"""Tables with a point per row as GeoParquet 1.1."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


def geoparquet(table: pa.Table) -> bytes:
    """A table with ``latitude_deg`` and ``longitude_deg`` (WGS84) as GeoParquet 1.1: the column ``geometry`` has points
    as well-known binary, longitude first. The same table gives the same bytes.

    >>> import pyarrow as pa
    >>> geoparquet(pa.table({"latitude_deg": [41.8], "longitude_deg": [-101.5]}))[:4]
    b'PAR1'
    """
    import pyarrow as pa
    import pyarrow.parquet as pq
    import shapely

    points = shapely.points(table.column("longitude_deg").to_numpy(), table.column("latitude_deg").to_numpy())
    table = table.append_column("geometry", pa.array(shapely.to_wkb(points).tolist(), pa.binary()))
    about = {
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": {
            "geometry": {
                "encoding": "WKB",
                "geometry_types": ["Point"],
                "bbox": shapely.total_bounds(points).tolist(),
            }
        },
    }
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), "geo": json.dumps(about)})
    stream = io.BytesIO()
    pq.write_table(table, stream, compression="zstd")
    return stream.getvalue()
