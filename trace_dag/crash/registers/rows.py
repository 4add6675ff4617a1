"""The rows of a register's table, kept on disk while they are read.

A table may be larger than memory, and the rows of one crash may lie far apart in it.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Mapping
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import printable
from trace_dag.crash.fields import MAX_TEXT
from trace_dag.crash.registers.mapping import RegisterMapping

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

Row = Mapping[str, Any]
"""One row: texts by column, and under :data:`TIME` when it was."""

TIME: Final = "time as read"
"""Key of a row's time, None if unknown."""
_AT_ONCE: Final = 20_000
_LONGEST_NARRATIVE: Final = 50_000
_SHOWN: Final = 60
_CONTROL: Final = r"[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]"  # those of right-to-left text reorder a line
_IN_ORDER: Final = """
SELECT kept.* EXCLUDE (number) FROM kept JOIN (SELECT id, min(number) AS first FROM kept GROUP BY id) USING (id)
ORDER BY first, number
"""


class RegisterRows:
    """The mapped columns of a CSV table. They are read once, when they are first asked for."""

    def __init__(self, mapping: RegisterMapping, path: Path) -> None:
        self._mapping, self._path = mapping, path

    @cached_property
    def columns(self) -> list[str]:
        """Return all columns of the table."""
        return list(next(self._frames(nrows=0)).columns)

    @cached_property
    def wanted(self) -> list[str]:
        """Return the columns that are read, the id of the crash first."""
        wanted = list(dict.fromkeys((self._mapping.crash.id, *self._mapping.columns())))
        if missing := [name for name in wanted if name not in self.columns]:
            raise UserError(
                f"{self._path}: no column {missing[0]!r}, which the mapping of {self._mapping.register_name} names; "
                f"there are {', '.join(self.columns)}"
            )
        return wanted

    def __len__(self) -> int:
        ((count,),) = self._database.cursor().execute("SELECT count(*) FROM kept").fetchall()
        return int(count)

    def crashes(self) -> Iterator[tuple[str, Iterator[Row]]]:
        """Return the id and the rows of each crash, in the order of the table by its first row."""
        names = [*self.wanted, TIME]
        found = self._database.cursor().execute(_IN_ORDER)
        rows = itertools.chain.from_iterable(iter(lambda: found.fetchmany(_AT_ONCE), []))
        return itertools.groupby((dict(zip(names, row, strict=True)) for row in rows), itemgetter(names[0]))

    @cached_property
    def _database(self) -> duckdb.DuckDBPyConnection:
        import duckdb
        import pandas as pd

        names, time = self.wanted, self._mapping.crash.time
        self._folder = tempfile.TemporaryDirectory(prefix="trace-dag-")  # removed with this object
        database = duckdb.connect(f"{self._folder.name}/rows.duckdb", config={"memory_limit": "256MB", "threads": 2})
        texts = ", ".join(f"column_{place} VARCHAR" for place in range(1, len(names)))
        database.execute(f"CREATE TABLE kept (number BIGINT, id VARCHAR, {texts}, time TIMESTAMP)")
        for frame in self._frames(usecols=names, chunksize=_AT_ONCE):
            frame = frame[names].fillna("").apply(lambda column: column.str.split().str.join(" "))
            self._check_texts(frame)
            frame.insert(0, "", frame.index)
            frame[TIME] = pd.to_datetime(frame[time.column], format=time.format, errors="coerce")
            database.execute("INSERT INTO kept SELECT * FROM frame")
        return database

    def _check_texts(self, frame: pd.DataFrame) -> None:
        """Raise :class:`UserError` for a value that is no text of a table, by the row and column where it stands."""
        for name in self.wanted:
            most = _LONGEST_NARRATIVE if name == self._mapping.crash.narrative else MAX_TEXT
            for wrong, what in (
                (frame[name].str.contains(_CONTROL), "a control character"),
                (frame[name].str.len() > most, f"more than {most:,} characters"),
            ):
                if wrong.any():
                    place = int(wrong.argmax())
                    row = int(frame.index[place]) + 2  # the header is the first, and they are counted from 1
                    begins = printable(frame[name].iloc[place][:_SHOWN])
                    raise UserError(f"{self._path}: row {row}, column {name!r}: {what} in {begins!r}; mend that row")

    def _frames(self, **options: Any) -> Iterator[pd.DataFrame]:
        import pandas as pd

        try:
            found = pd.read_csv(self._path, dtype=str, keep_default_na=False, encoding_errors="replace", **options)
            yield from [found] if isinstance(found, pd.DataFrame) else found
        except (OSError, ValueError) as error:
            raise UserError(f"{self._path} cannot be read as a CSV table: {error}") from error
