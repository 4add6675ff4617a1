"""Tables with a geometry per row as GeoParquet 1.1."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray


def geoparquet(table: pa.Table) -> bytes:
    """Return a table with ``latitude_deg`` and ``longitude_deg`` (WGS84) as GeoParquet 1.1.

    The column ``geometry`` has points as well-known binary, longitude first.

    Equal tables give equal bytes.

    >>> import pyarrow as pa
    >>> geoparquet(pa.table({"latitude_deg": [41.8], "longitude_deg": [-101.5]}))[:4]
    b'PAR1'
    """
    import shapely

    points = shapely.points(table.column("longitude_deg").to_numpy(), table.column("latitude_deg").to_numpy())
    return geoparquet_of(table, points)


def geoparquet_of(table: pa.Table, shapes: NDArray[Any]) -> bytes:
    """Return a table as GeoParquet with ``shapes`` (WGS84, longitude first), shape (n,), as column ``geometry``.

    >>> import pyarrow as pa
    >>> import shapely
    >>> geoparquet_of(pa.table({"name": ["a square"]}), shapely.box([0], [0], [1], [1]))[:4]
    b'PAR1'
    """
    import pyarrow as pa
    import pyarrow.parquet as pq
    import shapely

    table = table.append_column("geometry", pa.array(shapely.to_wkb(shapes).tolist(), pa.binary()))
    kinds = sorted({shape.geom_type + (" Z" if shape.has_z else "") for shape in shapes})
    about = {
        "version": "1.1.0",
        "primary_column": "geometry",
        "columns": {
            "geometry": {"encoding": "WKB", "geometry_types": kinds, "bbox": shapely.total_bounds(shapes).tolist()}
        },
    }
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), "geo": json.dumps(about)})
    stream = io.BytesIO()
    pq.write_table(table, stream, compression="zstd")
    return stream.getvalue()
