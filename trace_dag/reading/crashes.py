"""Crashes by key, as ``trace_dag.open`` returns them: of a root, a release, or one package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING
from weakref import WeakSet

from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.reading.crash import Crash

_SHOWN = ("final_state", "grade", "kind", "place", "trafficway_1", "trafficway_2")  # by a notebook, as they are there

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

    from trace_dag.flow.artefacts import CrashArtefacts
    from trace_dag.flow.workspace import Workspace


class Crashes(Mapping[str, Crash], ABC):
    """A mapping from keys to crashes, in their order, and tables over all of them.

    Crashes are read on first use, and once.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self._read: dict[str, Crash] = {}
        self._asked: WeakSet[duckdb.DuckDBPyConnection] = WeakSet()

    @property
    @abstractmethod
    def _keys(self) -> list[str]: ...

    @abstractmethod
    def _stored(self, key: str) -> CrashArtefacts: ...

    @property
    @abstractmethod
    def crashes(self) -> pd.DataFrame:
        """Return a row per crash, indexed by key."""

    def steps(self, keys: Iterable[str] | None = None) -> pd.DataFrame:
        """Return the steps of many crashes in one table, indexed by key.

        These are the crashes of ``keys``, or all simulated ones.
        """
        import pandas as pd

        chosen = [key for key in self if self[key].has("log")] if keys is None else list(keys)
        tables = [self[key].steps.assign(key=key) for key in chosen]
        return pd.concat(tables).set_index("key") if tables else pd.DataFrame()

    def sql(self, query: str) -> duckdb.DuckDBPyRelation:
        """Return the result of a query in SQL (DuckDB), read-only.

        ``.df()`` converts it for pandas, ``.to_arrow_table()`` for Arrow.

        A root has the tables that ``trace-dag tables`` lists; packages and releases have ``crashes``. Raises
        :class:`UserError` for a query that DuckDB refuses, and for a root without a warehouse. DuckDB limits neither
        the time nor the memory of a query; see :meth:`interrupt`.
        """
        import duckdb

        try:
            # Each question has a cursor of its own: a connection refuses a second one while it is busy.
            self._asked.add(cursor := self._connection.cursor())
            found = cursor.sql(query)
        except duckdb.Error as error:
            raise UserError(f"sql: {str(error).strip()}") from error
        if found is None:  # a statement without an answer, which DuckDB's stubs do not know
            raise UserError("sql: there is no query in it")
        return found

    def interrupt(self) -> None:
        """Stop the queries of :meth:`sql` that run in other threads."""
        for cursor in list(self._asked):
            cursor.interrupt()

    @property
    @abstractmethod
    def _connection(self) -> duckdb.DuckDBPyConnection:
        """Return the connection that answers questions."""

    @property
    def only(self) -> Crash:
        """Return the only crash.

        Raises :class:`UserError` if there are several.
        """
        if len(self) != 1:
            raise UserError(f"{self.place} holds {len(self)} crashes; take one by its key")
        return next(iter(self.values()))

    def __getitem__(self, key: str) -> Crash:
        if key not in self._read:
            if key not in self._known:
                raise KeyError(f"no crash {key} in {self.place}")
            self._read[key] = Crash(self._stored(key))
        return self._read[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    @cached_property
    def _known(self) -> frozenset[str]:
        return frozenset(self._keys)

    def __eq__(self, other: object) -> bool:
        """Return whether both are the same object; a comparison of contents would read all of it."""
        return self is other

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.place}: {count_of(len(self), 'crash', 'crashes')}>"

    def _repr_html_(self) -> str:
        columns = [name for name in _SHOWN if name in self.crashes.columns]
        return f"<p>{escape(repr(self))}</p>{self.crashes[columns].to_html(max_rows=10)}"


class Home(Crashes):
    """The crashes of a storage root, verified or not."""

    def __init__(self, workspace: Workspace) -> None:
        super().__init__(workspace.root)
        self.workspace = workspace

    @cached_property
    def _keys(self) -> list[str]:
        return self.workspace.registry.keys()

    def _stored(self, key: str) -> CrashArtefacts:
        from trace_dag.flow.stored_crashes import stored_crash

        return stored_crash(self.workspace, key)

    @property
    def crashes(self) -> pd.DataFrame:
        """Return the warehouse's view ``judged_crashes``, indexed by key.

        It has the state and reason of each crash, its grade and change of velocity, place, time, kind, classes.
        """
        frame: pd.DataFrame = self.sql("FROM judged_crashes").df()
        return frame.set_index("key")

    @cached_property
    def _connection(self) -> duckdb.DuckDBPyConnection:
        from trace_dag.warehouse.query import open_warehouse

        return open_warehouse(self.workspace.warehouse)
