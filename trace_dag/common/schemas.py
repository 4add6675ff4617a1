"""Columns declared once: name with its unit, type, meaning and source; Arrow schemas and data dictionaries follow.

Belongs here: the machinery. Does not belong here: any table; each package declares its own, as CSV, beside what fills
it.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from trace_dag.common.data_files import read_csv

if TYPE_CHECKING:
    import pyarrow as pa


class ColumnType(StrEnum):
    """Types a column can have; the value is DuckDB's name for it."""

    TEXT = "VARCHAR"
    INTEGER = "INTEGER"
    REAL = "DOUBLE"
    BOOLEAN = "BOOLEAN"


_STRUCT = "STRUCT"  # the type, by DuckDB, of a column with fields


@dataclass(frozen=True)
class Column:
    """One column of a stored table.

    ``unit`` is also the suffix of the name where there is one; ``source`` the element of the source it comes from
    (FARS names in capitals). ``fields`` makes it a struct of those columns; ``repeated`` a list.
    """

    name: str
    type: ColumnType | None
    meaning: str
    unit: str = ""
    source: str = ""
    required: bool = False
    repeated: bool = False
    fields: tuple[Column, ...] = ()

    def __post_init__(self) -> None:
        if (self.type is None) != bool(self.fields):
            raise ValueError(f"column {self.name}: give either a type or fields")

    def arrow_type(self) -> pa.DataType:
        """Return the Arrow type, nested for ``fields`` or ``repeated``."""
        import pyarrow as pa

        if self.type is None:
            item = pa.struct([field.arrow_field() for field in self.fields])
        else:
            item = {
                ColumnType.TEXT: pa.string(),
                ColumnType.INTEGER: pa.int32(),
                ColumnType.REAL: pa.float64(),
                ColumnType.BOOLEAN: pa.bool_(),
            }[self.type]
        return pa.list_(pa.field("item", item, nullable=False)) if self.repeated else item

    def arrow_field(self) -> pa.Field:
        """Return the Arrow field, its unit, meaning and source as field metadata."""
        import pyarrow as pa

        metadata = {"meaning": self.meaning, "unit": self.unit, "source": self.source}
        return pa.field(
            self.name,
            self.arrow_type(),
            nullable=not self.required,
            metadata={key: value for key, value in metadata.items() if value},
        )

    def walk(self, prefix: str = "") -> Iterator[tuple[str, Column]]:
        """Yield this column and its nested columns, each with its dotted path."""
        path = prefix + self.name
        yield path, self
        for field in self.fields:
            yield from field.walk(f"{path}.")


@dataclass(frozen=True)
class TableSchema:
    """A stored table: its columns in order."""

    name: str
    meaning: str
    columns: tuple[Column, ...]

    @classmethod
    def of_csv(cls, package: str, name: str, meaning: str) -> TableSchema:
        """Return the table whose columns a package declares in ``<name>.csv``, nested ones by dotted path."""
        within: dict[str, tuple[Column, ...]] = {"": ()}
        for row in reversed(read_csv(package, f"{name}.csv")):  # nested columns before the one that has them
            parent, _, own = row["column"].rpartition(".")
            column = Column(
                own,
                None if row["type"] == _STRUCT else ColumnType(row["type"]),
                row["meaning"],
                row["unit"],
                row["source"],
                required=row["required"] == "yes",
                repeated=row["repeated"] == "yes",
                fields=within.pop(row["column"], ()),
            )
            within[parent] = (column, *within.get(parent, ()))
        return cls(name, meaning, within[""])

    def __getitem__(self, name: str) -> Column:
        """Return a column by its name."""
        return next(column for column in self.columns if column.name == name)

    def arrow(self) -> pa.Schema:
        """Return the Arrow schema, with every column's unit, meaning and source in its metadata."""
        import pyarrow as pa

        return pa.schema([column.arrow_field() for column in self.columns], metadata={"meaning": self.meaning})

    def dictionary(self) -> list[dict[str, str]]:
        """Return the data dictionary: one row per column, nested ones by dotted path."""
        return [
            {
                "column": path,
                "type": column.type.value if column.type else _STRUCT,
                "unit": column.unit,
                "meaning": column.meaning,
                "source": column.source,
            }
            for top in self.columns
            for path, column in top.walk()
        ]


def table_from_parquet(data: bytes) -> pa.Table:
    """Return the table in a Parquet file.

    Raises pyarrow's errors. It is read by one thread: tables are small, and Arrow's thread pools would delay the end of
    a short command.
    """
    import pyarrow.parquet as pq

    return pq.ParquetFile(io.BytesIO(data)).read(use_threads=False)
