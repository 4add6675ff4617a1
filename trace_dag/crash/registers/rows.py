"""The rows of a register's table, kept on disk while they are read.

A table may be larger than memory, lie in several files, and have the rows of one crash far apart. Its
files are as programs save them: text in several encodings, compressed or not.
"""

from __future__ import annotations

import codecs
import csv
import itertools
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fnmatch import fnmatch
from functools import cached_property
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import printable
from trace_dag.crash.fields import MAX_TEXT
from trace_dag.crash.registers.mapping import EPOCHS, ISO8601, MOMENT, JoinedFile, RegisterMapping, parts_of

if TYPE_CHECKING:
    import duckdb

Row = Mapping[str, Any]
"""One row: texts by column, and under :data:`TIME` when it was."""
_SEPARATORS: Final = ",;\t|"
_NOT_TABLES: Final = {
    b"PK\x03\x04": "an Excel workbook or a zip archive: save the sheet as CSV, or unpack the archive",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save the sheet as CSV",
    b"{": "JSON: save it as CSV with a column of latitudes and one of longitudes",
    b"[": "JSON: save it as CSV with a column of latitudes and one of longitudes",
    b"PAR1": "Parquet: save it as CSV",
}


class ReportedTime(NamedTuple):
    """A local time; None where a part is not reported."""

    year: int | None = None
    month: int | None = None
    day: int | None = None
    hour: int | None = None
    minute: int | None = None


TIME: Final = "time as read"
"""Key of a row's :class:`ReportedTime`."""
KIND: Final = "kind as read"
"""Key of what a row is by its file, as :attr:`trace_dag.crash.registers.mapping.JoinedFile.kind`; None of most."""
_AT_ONCE: Final = 20_000
_SPOOLED_TOGETHER: Final = 1_000
_LONGEST_NARRATIVE: Final = 50_000
_MOST_FILE_ROWS: Final = 1_000_000_000
_SHOWN: Final = 60
_CONTROL: Final = (
    r"[\x00-\x1f\x7f-\x9f\x{202a}-\x{202e}\x{2066}-\x{2069}]"  # those of right-to-left text reorder a line
)
_FAR_DEG: Final = 0.05  # 5 km: rows of one crash do not lie so far apart


class RegisterRows:
    """The mapped columns of a table. They are read once, on first use."""

    def __init__(self, mapping: RegisterMapping, path: Path) -> None:
        self._mapping, self._path = mapping, path
        self._count = 0  # of the rows, once they are read

    @cached_property
    def _files(self) -> list[list[Path]]:
        """Return the files of the crashes, then the joined files in the mapping's order."""
        folder = self._path if self._path.is_dir() else self._path.parent
        patterns = [each.name for each in self._mapping.files]
        found = [[each for each in sorted(folder.glob("*")) if _is_named(each, name)] for name in patterns]
        own = [self._path]
        if self._path.is_dir():
            own = [each for each in sorted(folder.glob("*")) if _is_named(each, self._mapping.table)]
        for name, paths in zip([self._mapping.table, *patterns], [own, *found], strict=True):
            if not paths:
                there = ", ".join(sorted(each.name for each in folder.glob("*"))[:12]) or "nothing"
                raise UserError(
                    f"{folder}: no file {name}, which the mapping of {self._mapping.register_name} names; "
                    f"it has {there}"
                )
        return [own, *found]

    @cached_property
    def _folder(self) -> Path:
        self._temporary = tempfile.TemporaryDirectory(prefix="trace-dag-")  # removed with this object
        return Path(self._temporary.name)

    @property
    def spooled(self) -> Path:
        """Return the file of reports that were made of the rows."""
        return self._folder / "reports.parquet"

    @contextmanager
    def spool(self) -> Iterator[Callable[[str, bytes], None]]:
        """Yield a function to call with each report made from the rows; the reports are kept once all are made."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema = pa.schema([("key", pa.string()), ("report", pa.binary())])
        keys: list[str] = []
        reports: list[bytes] = []
        unfinished = self.spooled.with_suffix(".part")

        def add(key: str, report: bytes) -> None:
            keys.append(key)
            reports.append(report)
            if len(keys) == _SPOOLED_TOGETHER:
                write()

        def write() -> None:
            writer.write_table(pa.table([keys, reports], schema=schema))
            keys.clear()
            reports.clear()

        with pq.ParquetWriter(unfinished, schema, compression="zstd") as writer:
            yield add
            write()
        unfinished.replace(self.spooled)
        self.__dict__.pop("_database").close()  # a quarter of a gigabyte; it is made again if need be

    def read_spooled(self) -> Iterator[tuple[str, bytes]]:
        """Yield key and report in the order in which they were kept."""
        import pyarrow.parquet as pq

        for batch in pq.ParquetFile(self.spooled).iter_batches(_SPOOLED_TOGETHER):
            yield from zip(batch["key"].to_pylist(), batch["report"].to_pylist(), strict=True)

    @cached_property
    def _headers(self) -> list[list[str]]:
        """Return the columns of each file; for a table in several files, those of the first."""
        return [read_header(paths[0], self._mapping.separator)[0] for paths in self._files]

    @cached_property
    def columns(self) -> list[str]:
        """Return all columns of the table."""
        return list(dict.fromkeys(itertools.chain.from_iterable(self._headers)))

    @cached_property
    def wanted(self) -> list[str]:
        """Return the columns that are read, the id of the crash first."""
        joined = (name for file in self._mapping.files for name in (*file.on, *file.on.values(), *file.where))
        wanted = list(dict.fromkeys((self._mapping.crash.id, *self._mapping.columns(), *joined)))
        if missing := [name for name in wanted if name not in self.columns]:
            raise UserError(
                f"{self._path}: no column {missing[0]!r}, which the mapping of {self._mapping.register_name} names; "
                f"there are {', '.join(self.columns)}"
            )
        return wanted

    @cached_property
    def _at(self) -> dict[str, str]:
        """Return the database's name of each column."""
        return {name: f"c{place}" for place, name in enumerate(self.wanted)}

    def __len__(self) -> int:
        return self._count

    def crashes(self) -> Iterator[tuple[str, Iterator[Row]]]:
        """Return the id and the rows of each crash, ordered by its first row in the table."""
        names, kinds = self.wanted, [None, *(file.kind for file in self._mapping.files)]
        found = self._database.cursor().execute("SELECT * EXCLUDE (number, first) FROM kept ORDER BY first, number")
        rows = itertools.chain.from_iterable(iter(lambda: found.fetchmany(_AT_ONCE), []))
        whole = (
            {**dict(zip(names, row, strict=False)), TIME: ReportedTime(*row[len(names) : -1]), KIND: kinds[row[-1]]}
            for row in rows
        )
        return itertools.groupby(whole, itemgetter(names[0]))

    @cached_property
    def _database(self) -> duckdb.DuckDBPyConnection:
        import duckdb

        database = duckdb.connect(f"{self._folder / 'rows.duckdb'}", config={"memory_limit": "256MB", "threads": 2})
        for place, paths in enumerate(self._files):
            self._read(database, place, paths)
        self._check_ids(database)
        texts = ", ".join(f"coalesce({column}, '') AS {column}" for column in self._at.values())
        times = ", ".join(f"{expression} AS {part}" for part, expression in self._moment().items())
        first = f"min(number) OVER (PARTITION BY {self._at[self._mapping.crash.id]}) AS first"
        database.execute(f"CREATE TABLE kept AS SELECT number, {first}, {texts}, {times}, file FROM ({self._joined()})")
        self._check_rows_agree(database)
        ((self._count,),) = database.execute("SELECT count(*) FROM kept").fetchall()
        return database

    def _read(self, database: duckdb.DuckDBPyConnection, place: int, paths: Sequence[Path]) -> None:
        """Read one file, or the parts of one table, into a table ``file_<place>`` of normalised texts."""
        import duckdb

        wanted = {name: self._at[name] for name in self._headers[place] if name in self._at}
        for number, path in enumerate(paths):
            header, separator = read_header(path, self._mapping.separator)
            if missing := [name for name in wanted if name not in header]:
                raise UserError(f"{path}: no column {missing[0]!r}, which {paths[0].name} has")
            copy = copy_as_utf8(path, self._folder / f"{place}-{number}.csv")
            texts = ", ".join(f"{_normalised(f'x{header.index(name)}')} AS {at}" for name, at in wanted.items())
            kinds = ", ".join(f"'x{at}': 'VARCHAR'" for at in range(len(header)))
            try:
                database.execute(
                    f"{'INSERT INTO' if number else 'CREATE TABLE'} file_{place} {'' if number else 'AS'} "
                    f"SELECT row_number() OVER () + 1 AS number, {texts} FROM read_csv({_literal(str(copy))}, "
                    f"delim={_literal(separator)}, quote='\"', escape='\"', header=true, auto_detect=false, "
                    f"strict_mode=true, max_line_size=100000000, columns={{{kinds}}})"
                )
            except duckdb.Error as error:
                said = [line for line in str(error).splitlines() if "CSV Error on Line" in line or "Columns" in line]
                why = "; ".join(said) or str(error).splitlines()[0]
                raise UserError(f"{path} cannot be read as a CSV table: {why}; mend that row") from error
            copy.unlink()
            self._check_texts(database, place, path, wanted)

    def _check_texts(
        self, database: duckdb.DuckDBPyConnection, place: int, path: Path, wanted: Mapping[str, str]
    ) -> None:
        """Raise :class:`UserError` for a value that is too long for text, with its row and column."""
        for name, at in wanted.items():
            most = _LONGEST_NARRATIVE if name == self._mapping.crash.narrative else MAX_TEXT
            found = database.execute(
                f"SELECT number, {at}, length({at}) > {most} FROM file_{place} "
                f"WHERE length({at}) > {most} OR regexp_matches({at}, '{_CONTROL}') ORDER BY number LIMIT 1"
            ).fetchone()
            if found is not None:
                what = f"more than {most:,} characters" if found[2] else "a control character"
                begins = printable(found[1][:_SHOWN])
                raise UserError(f"{path}: row {found[0]}, column {name!r}: {what} in {begins!r}; mend that row")

    def _joined(self) -> str:
        """Return the query of all rows: one for each unit, or each crash."""
        columns = [[self._at[name] for name in header if name in self._at] for header in self._headers]
        query, present = "SELECT *, 0 AS file FROM file_0", set(columns[0])
        if units := [(place, file) for place, file in enumerate(self._mapping.files, 1) if file.units]:
            parts = []
            for order, (place, file) in enumerate(units):
                number = f"c.number * {_MOST_FILE_ROWS} * {len(units)} + {order} * {_MOST_FILE_ROWS} + u.number"
                own = "".join(f", u.{column}" for column in columns[place] if column not in present)
                parts.append(
                    f"SELECT c.* REPLACE ({number} AS number){own}, {place} AS file FROM file_0 c "
                    f"JOIN file_{place} u ON {self._keys(file, 'u', 'c', present)} WHERE {self._rows_of(file)}"
                )
            query = " UNION ALL BY NAME ".join(parts)
            present = present.union(*(columns[place] for place, _ in units))
        for place, file in enumerate(self._mapping.files, 1):
            if file.units:
                continue
            keys = ", ".join(self._at[name] for name in file.on)
            first = (
                f"SELECT DISTINCT ON ({keys}) * FROM file_{place} WHERE {self._rows_of(file)} ORDER BY {keys}, number"
            )
            shared = [f"coalesce(c.{column}, j.{column}) AS {column}" for column in columns[place] if column in present]
            own = "".join(f", j.{column}" for column in columns[place] if column not in present)
            replaced = f" REPLACE ({', '.join(shared)})" if shared else ""
            query = (
                f"SELECT c.*{replaced}{own} FROM ({query}) c "
                f"LEFT JOIN ({first}) j ON {self._keys(file, 'j', 'c', present)}"
            )
            present.update(columns[place])
        return query

    def _keys(self, file: JoinedFile, own: str, before: str, present: set[str]) -> str:
        pairs = [(self._at[name], self._at[other]) for name, other in file.on.items()]
        return " AND ".join(f"{own}.{name} = {before}.{other}" for name, other in pairs if other in present)

    def _rows_of(self, file: JoinedFile) -> str:
        said = (f"{self._at[name]} IN ({', '.join(map(_literal, them))})" for name, them in file.where.items())
        return " AND ".join(["true", *said])

    def _moment(self) -> dict[str, str]:
        """Return an expression for each part of the time; NULL for parts without a column."""
        time, found = self._mapping.crash.time, dict.fromkeys(MOMENT, "NULL::SMALLINT")
        for column, form in zip(time.column, time.format, strict=True):
            text = self._at[column]
            read = _timestamp(text, form, time.zone)
            for part in parts_of(form):
                found[part] = f"{part}({read})::SMALLINT"
                if form == ISO8601 and part in ("hour", "minute"):  # a date alone has none
                    found[part] = f"CASE WHEN regexp_matches({text}, '\\d[T ]\\d') THEN {found[part]} END"
        return found

    def _check_ids(self, database: duckdb.DuckDBPyConnection) -> None:
        """Raise :class:`UserError` for an id in two rows, if a row is a crash."""
        if self._mapping.rows == "unit" and not any(file.units for file in self._mapping.files):
            return
        twice = database.execute(
            f"SELECT {self._at[self._mapping.crash.id]}, min(number), max(number) FROM file_0 "
            "GROUP BY 1 HAVING count(*) > 1 ORDER BY 2 LIMIT 1"
        ).fetchone()
        if twice is not None:
            raise UserError(
                f"{self._files[0][0]}: id {twice[0]!r} stands in rows {twice[1]} and {twice[2]}; "
                "the mapping says that a row is a crash"
            )

    def _check_rows_agree(self, database: duckdb.DuckDBPyConnection) -> None:
        """Raise :class:`UserError` for an id that is used for crashes of several years or places."""
        crash, checks = self._mapping.crash, {"year": ("year", 0.0)}
        if crash.latitude_deg is not None and crash.longitude_deg is not None:
            for name in (crash.latitude_deg, crash.longitude_deg):
                checks[name] = (f"nullif(try_cast(replace({self._at[name]}, ',', '.') AS DOUBLE), 0)", _FAR_DEG)
        for name, (value, most) in checks.items():
            found = database.execute(
                f"SELECT {self._at[crash.id]}, arg_min(number, {value}), arg_max(number, {value}), min({value}), "
                f"max({value}) FROM kept GROUP BY 1 HAVING max({value}) - min({value}) > {most} "
                "ORDER BY min(number) LIMIT 1"
            ).fetchone()
            if found is not None:
                crash_id, *rows, low, high = found
                raise UserError(
                    f"{self._path}: id {crash_id!r} stands for two crashes: {name} {low} in row {rows[0]} and {high} "
                    f"in row {rows[1]}; expected one id for each crash"
                )


def _timestamp(text: str, form: str, zone: str | None) -> str:
    """Return an expression for a column's local time, NULL if it is not in the format."""
    local = f"AT TIME ZONE {_literal(zone)}" if zone else ""
    if form in EPOCHS:
        number = f"try_cast(try_cast({text} AS DOUBLE) * {EPOCHS[form]} AS BIGINT)"
        return f"(CASE WHEN abs({number}) < 1e14 THEN make_timestamp_ms({number}) END AT TIME ZONE 'UTC' {local})"
    if form == ISO8601:
        offset = f"regexp_matches({text}, ':\\d\\d.*(Z|[+-]\\d\\d(:?\\d\\d)?)$')"
        there = f"try_cast({text} AS TIMESTAMPTZ) {local}" if zone else "NULL"
        return f"(CASE WHEN {offset} THEN {there} ELSE try_cast({text} AS TIMESTAMP) END)"
    if form == "%H%M":
        text = f"CASE WHEN length({text}) BETWEEN 1 AND 4 THEN lpad({text}, 4, '0') END"
    read = f"try_strptime({text}, {_literal(form)})"
    if zone is None:
        return read
    return f"({read} {local})" if form.endswith("%z") else f"({read} AT TIME ZONE 'UTC' {local})"


def _normalised(column: str) -> str:
    return f"trim(regexp_replace(coalesce({column}, ''), '[\\s\\x0b\\p{{Z}}]+', ' ', 'g'))"


def _literal(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _is_named(path: Path, pattern: str) -> bool:
    return path.is_file() and fnmatch(path.name.casefold(), pattern.casefold())


# --- files -----------------------------------------------------------------------------------------------------------
def _windows_1252(error: UnicodeError) -> str:
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("cp1252", "replace")


def read_header(path: Path, separator: str | None) -> tuple[list[str], str]:
    """Return the columns of a table and their separator, which is detected if not given."""
    with _opened(path) as file:
        line = file.readline()
    found = separator or max(_SEPARATORS, key=line.count)
    header = next(csv.reader([line.lstrip("\ufeff").rstrip("\r\n")], delimiter=found), [])
    if not any(header):
        raise UserError(f"{path} cannot be read as a CSV table: it begins with a blank line; expected its columns")
    return header, found


def copy_as_utf8(path: Path, copy: Path) -> Path:
    """Write a table's text as UTF-8; return the copy."""
    with _opened(path) as file, copy.open("w", encoding="utf-8", newline="") as target:
        shutil.copyfileobj(file, target, 1 << 20)
    return copy


def _opened(path: Path) -> Any:
    """Open a table as text: UTF-8, UTF-16 or Windows-1252, also compressed as .gz, .bz2 or .xz."""
    import fsspec

    try:
        with fsspec.open(str(path), "rb", compression="infer") as file:
            begins = file.read(4)
        if what := next((said for magic, said in _NOT_TABLES.items() if begins.startswith(magic)), None):
            raise UserError(f"{path} is not a CSV table; it is {what}")
        utf16 = begins.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return fsspec.open(
            str(path),
            "rt",
            compression="infer",
            encoding="utf-16" if utf16 else "utf-8-sig",
            errors="windows-1252",
            newline="",
        ).open()
    except OSError as error:
        raise UserError(f"{path} cannot be read as a CSV table: {error}") from error


codecs.register_error("windows-1252", lambda error: (_windows_1252(error), getattr(error, "end", 0)))


def first_rows(path: Path, most: int) -> tuple[list[str], list[list[str]]]:
    """Return the columns of a table and its first rows."""
    header, separator = read_header(path, None)
    with _opened(path) as file:
        reader = csv.reader(file, delimiter=separator)
        return header, [row for row in islice(reader, 1, most + 1) if row]
