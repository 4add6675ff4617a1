"""Questions to the warehouse: ``sql``, ``tables`` and ``find``, with rows as files for Excel, maps and Parquet."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import OutputFile, examples, kind_of_file, pass_root
from trace_dag.cli.printing import print_table, say, write_csv, write_json
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.storage.disk_errors import name_file_in_errors

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

_LOOKED_AT, _WIDEST = 1000, 60  # rows that tell how wide a column is, and the most characters it gets
_LATITUDE, _LONGITUDE = "latitude_deg", "longitude_deg"
_SHOWN = 20
_COLUMNS = ("key", "final_state", "pre_crash_scenario", "light", "place", "kind", "euro_ncap", "odd")
_PRINTED = 5  # of the columns


def write_rows(path: Path, output: str, names: Sequence[str], rows: Sequence[Sequence[Any]] | pa.Table) -> None:
    """Write rows, for Parquet a typed table, into a file of one of :data:`FORMATS`.

    Raises :class:`UserError` for rows that the format cannot hold.
    """
    FORMATS[output](path, names, rows)


def _frame(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame([list(row) for row in rows], columns=list(names))


def _write_excel(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write one sheet.

    Text of a report stays text, although Excel would take "=..." for a formula and "http..." for a link.
    """
    import pandas as pd

    options = {"strings_to_formulas": False, "strings_to_urls": False}
    frame = _frame(names, [[_cell(value) for value in row] for row in rows])
    with pd.ExcelWriter(path, engine="xlsxwriter", engine_kwargs={"options": options}) as writer:
        frame.to_excel(writer, sheet_name="trace-dag", index=False)
        sheet = writer.sheets["trace-dag"]
        sheet.freeze_panes(1, 1)
        sheet.autofilter(0, 0, len(rows), max(len(names) - 1, 0))
        for k, name in enumerate(names):
            longest = max([len(name) + 3, *(len(str(value)) for value in frame[name].head(_LOOKED_AT))])
            sheet.set_column(k, k, min(longest + 1, _WIDEST))


def _cell(value: object) -> object:
    """Return a list or structure as JSON, since a cell holds one value; return other values unchanged."""
    return json.dumps(value, default=str) if isinstance(value, list | dict | tuple) else value


def _write_geojson(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write a point for each row (RFC 7946: WGS84, longitude first); rows without a position have no geometry."""
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


def _write_parquet(path: Path, _names: Sequence[str], rows: pa.Table) -> None:
    """Write rows with the types of the answer.

    DuckDB's 38-digit sums of integers become integers if they fit.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    for k, field in enumerate(rows.schema):
        if field.type == pa.decimal128(38, 0):
            with suppress(pa.ArrowInvalid):
                rows = rows.set_column(k, field.name, rows.column(k).cast(pa.int64()))
    pq.write_table(rows, path)


def _write_csv(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    _frame(names, rows).to_csv(path, index=False)


def _write_json(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    found = [dict(zip(names, row, strict=True)) for row in rows]
    path.write_text(json.dumps(found, ensure_ascii=False, default=str, indent=1), encoding="utf-8")


PRINTED = frozenset({"csv", "json"})
"""Those that the terminal can show as well."""
FORMATS: dict[str, Callable[[Path, Sequence[str], Any], None]] = {
    "csv": _write_csv,
    "json": _write_json,
    "xlsx": _write_excel,
    "geojson": _write_geojson,
    "parquet": _write_parquet,
}
"""Writers of each format."""


@click.command(
    epilog=examples(
        'trace-dag sql "SELECT * FROM funnel"',
        'trace-dag sql "SELECT key, accepted FROM verdicts" --format csv',
        'trace-dag sql "FROM judged_crashes" --output crashes.xlsx',
    )
)
@click.argument("query")
@click.option(
    "--format",
    "output",
    type=click.Choice(["table", *FORMATS]),
    help="How the rows are printed, a table unless said, or the kind of file; else the file's name says it.",
)
@click.option(
    "--output", "path", type=OutputFile(), help=f"The file to write: {', '.join(f'.{name}' for name in FORMATS)}."
)
@pass_root
def sql(root: str, query: str, output: str | None, path: Path | None) -> None:
    """Ask the warehouse in SQL (DuckDB), read-only.

    trace-dag tables lists the tables, columns and their meaning. Rows that are wider than the terminal are printed as a
    block each.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import ask, query_typed
    from trace_dag.warehouse.query import query as rows_of

    output = kind_of_file("sql", path, output, FORMATS)
    if (path is not None and output not in FORMATS) or (path is None and output in FORMATS and output not in PRINTED):
        raise UserError(f"sql: --format {output} {'needs --output FILE' if path is None else 'is for the terminal'}")
    workspace = Workspace.open(root, to_read=True)
    how: Any = query_typed if output == "parquet" else rows_of
    names, rows = ask(workspace.warehouse, query, workspace.settings.warehouse, how)
    if path is not None:
        with name_file_in_errors(path):
            write_rows(path, str(output), names, rows)
        say(f"{path}  {count_of(len(rows), 'row')}")
    elif output == "csv":
        write_csv(names, rows)
    elif output == "json":
        write_json([dict(zip(names, row, strict=True)) for row in rows])
    else:
        print_table(names, rows, fit=True)


@click.command(epilog=examples("trace-dag tables", "trace-dag tables verdicts", 'trace-dag tables "impact speed"'))
@click.argument("words", metavar="[TABLE | WORDS]", required=False)
@pass_root
def tables(root: str, words: str | None) -> None:
    """List the tables and views of the warehouse with their meaning, or the columns of one of them.

    Any other words find the columns that have all of them in their name or meaning.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import columns_of, tables_of

    warehouse = Workspace.open(root, to_read=True).warehouse
    if words is None:
        print_table(["table", "rows", "what it holds"], tables_of(warehouse))
        return
    columns = columns_of(warehouse)
    if own := [column[1:] for column in columns if column[0] == words]:
        print_table(["column", "type", "what it means"], own)
        return
    sought = words.lower().replace("_", " ").split()
    found = [each for each in columns if all(word in " ".join(each).lower().replace("_", " ") for word in sought)]
    if not found:
        raise UserError(
            f"tables {words}: no table has this name and no column this meaning; trace-dag tables lists all"
        )
    print_table(["table", "column", "type", "what it means"], found)


@click.command(epilog=examples('trace-dag find "night pedestrian signalised"', "trace-dag find motorcycle T-junction"))
@click.argument("words", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="All that are found, as JSON.")
@pass_root
def find(root: str, words: tuple[str, ...], as_json: bool) -> None:
    """Find crashes that match all given words in kind, conditions, road, place, parties, domain or summary.

    A word matches the beginnings of words. Verified crashes come first. The words are those of the warehouse's table
    catalogue; sql can search further.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import ask, query

    sought = [word.lower().replace("'", "''") for word in " ".join(words).split()]
    where = " AND ".join(f"contains(' ' || words, ' {word}')" for word in sought)
    workspace = Workspace.open(root, to_read=True)
    sql = (
        f"SELECT {', '.join(_COLUMNS)} FROM catalogue JOIN crashes USING (key) WHERE {where} "  # noqa: S608 - read-only
        "ORDER BY final_state <> 'verified', key"
    )
    names, rows = ask(workspace.warehouse, sql, workspace.settings.warehouse, query)
    if as_json:
        write_json([dict(zip(names, row, strict=True)) for row in rows])
        return
    if not rows:
        raise UserError(f"find {' '.join(words)}: no crash has all of these words; leave one out")
    print_table(names[:_PRINTED], [row[:_PRINTED] for row in rows[:_SHOWN]], fit=True)
    more = f"; --json lists all, {_SHOWN} are shown" if len(rows) > _SHOWN else ""
    say(f"{count_of(len(rows), 'crash', 'crashes')}{more}")
