"""Dagster's event log in SQLite files, with connections that stay open and events that are packed.

Dagster's own class makes an engine and opens a file anew for each of the fourteen events a crash causes: every
statement is compiled again, and SQLite writes its log back into the database at each close. It also looks up the
columns of a table for each event, and knows no batches. Keeping the engines and writing what comes together in one
transaction takes an eighth of the time, for a run's plan a twentieth; a run's materializations wait for each other for
that (:meth:`EventLog.together`). Events are packed
(:mod:`trace_dag.assets.event_packing`), a tenth of their size; so the files lie in a folder of their own, and
Dagster's class, which could not read them, keeps its own where it always does.

A killed process loses nothing that was committed. What still waited is lost with it, and the last events (never the
database) where a machine loses power: the artefacts say what was done, and the next run of these crashes, or
``trace-dag verify --repair``, tells Dagster again.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from time import monotonic
from typing import Any

from dagster import DagsterEventType, EventLogEntry, Field, StringSource
from sqlalchemy import Connection, Engine, create_engine, event

from trace_dag.assets.dagster_internals import (
    AssetCheckExecutionsTable,
    AssetKeyTable,
    ConfigurableClassData,
    DynamicPartitionsTable,
    SqlEventLogStorageTable,
    SqliteEventLogStorage,
)
from trace_dag.assets.event_packing import PackedText, pack_events_of

_FOLDER = "history/packed"  # below DAGSTER_HOME
_WAIT_FOR_OTHERS_S = 60.0
_AT_ONCE = {DagsterEventType.ASSET_MATERIALIZATION_PLANNED, DagsterEventType.ASSET_MATERIALIZATION}
_FILES_OPEN = 8  # the index, and the runs last written to or looked at
_WAIT_FOR_EACH_OTHER = 100  # materializations, those of some fifteen crashes
_WAIT_S = 2.0  # where crashes take minutes, as in CARLA, each is seen in the UI when it is done

# All columns that hold events, of tables that are one for all databases: packed where the engine is ours.
for _column in (
    SqlEventLogStorageTable.c.event,
    AssetKeyTable.c.last_materialization,
    AssetCheckExecutionsTable.c.evaluation_event,
):
    _column.type = _column.type.with_variant(PackedText(), "sqlite")


class EventLog(SqliteEventLogStorage):
    """Dagster's event log of a storage root. ``folder`` is taken from ``DAGSTER_HOME``."""

    def __init__(self, folder: str = _FOLDER, inst_data: ConfigurableClassData | None = None) -> None:
        self._engines: OrderedDict[str, Engine] = OrderedDict()
        self._tables: set[str] = set()
        self._waiting: list[EventLogEntry] | None = None  # None: nothing waits
        self._last_written_s = 0.0
        super().__init__(str(Path(os.environ["DAGSTER_HOME"]) / folder), inst_data)

    @classmethod
    def config_type(cls) -> dict[str, Any]:
        """The configuration that ``dagster.yaml`` may give."""
        return {"folder": Field(StringSource, is_required=False, default_value=_FOLDER)}

    @classmethod
    def from_config_value(cls, inst_data: ConfigurableClassData | None, config_value: Mapping[str, Any]) -> EventLog:
        """The log that ``dagster.yaml`` asks for."""
        return cls(config_value["folder"], inst_data)

    def has_table(self, table_name: str) -> bool:
        """Whether the index has a table; asked for each event, and tables are never taken away."""
        if table_name not in self._tables and super().has_table(table_name):
            self._tables.add(table_name)
        return table_name in self._tables

    @contextmanager
    def together(self) -> Iterator[None]:
        """Within it, materializations wait until there are some to be written at once, or two seconds have gone by.

        Whatever else is stored or looked up here meanwhile writes them first, so that only other processes see them
        later, and all events come in their order.
        """
        self._waiting, self._last_written_s = [], monotonic()
        try:
            yield
        finally:
            waiting, self._waiting = self._waiting, None
            self.store_event_batch(waiting or [])

    def _write_waiting(self) -> None:
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._last_written_s = monotonic()
            self.store_event_batch(waiting)

    def dispose(self) -> None:
        """Close the files."""
        with self._db_lock:
            while self._engines:
                self._engines.popitem()[1].dispose()
        super().dispose()

    def store_event(self, event: EventLogEntry) -> None:
        """Store one event, or let it wait for others (:meth:`together`)."""
        if self._waiting is None or _kind(event) is not DagsterEventType.ASSET_MATERIALIZATION:
            self.store_event_batch([event])
            return
        self._waiting.append(event)
        if len(self._waiting) >= _WAIT_FOR_EACH_OTHER or monotonic() - self._last_written_s > _WAIT_S:
            self._write_waiting()

    def store_event_batch(self, events: Sequence[EventLogEntry]) -> None:
        """Store events in their order: planned ones next to each other at once, and materializations likewise."""
        for (_, kind), group in groupby(events, key=lambda event: (event.run_id, _kind(event))):
            if kind in _AT_ONCE:
                self._store_at_once(list(group))
            else:
                for event in group:
                    super().store_event(event)

    def _store_at_once(self, events: Sequence[EventLogEntry]) -> None:
        insert, rows = SqlEventLogStorageTable.insert(), [self._event_to_row(event) for event in events]
        with self.run_connection(events[0].run_id) as connection:
            connection.execute(insert, rows)
        with self.index_transaction() as connection:
            ids = [connection.execute(insert, row).lastrowid for row in rows]
            self._store_asset_event_tags(connection, events, ids)
            # Of each asset, the latest event is what the table of assets holds.
            latest = {row["asset_key"]: (event, id_) for row, event, id_ in zip(rows, events, ids, strict=True)}
            for asset_key, (event, id_) in latest.items():
                values = self._get_asset_entry_values(event, id_, has_asset_key_index_cols=True)
                known = connection.execute(
                    AssetKeyTable.update().where(AssetKeyTable.c.asset_key == asset_key).values(**values)
                )
                if not known.rowcount:
                    connection.execute(AssetKeyTable.insert().values(asset_key=asset_key, **values))

    def get_dynamic_partitions(self, partitions_def_name: str) -> Sequence[str]:
        """All partitions in the order in which they were added.

        A run asks a dozen times, and of a year SQLAlchemy would make 36,000 rows of its own each time.
        """
        asked = "SELECT partition FROM dynamic_partitions WHERE partitions_def_name = ? ORDER BY id"
        with self.index_connection() as connection:
            cursor = connection.connection.cursor()
            try:
                cursor.execute(asked, (partitions_def_name,))
                return [partition for (partition,) in cursor.fetchall()]
            finally:
                cursor.close()

    def delete_dynamic_partitions(self, definition: str, keys: Sequence[str]) -> None:
        """Take away several partitions in one statement; Dagster's own class takes one at a time."""
        table = DynamicPartitionsTable
        with self.index_connection() as connection:
            connection.execute(
                table.delete().where(table.c.partitions_def_name == definition, table.c.partition.in_(keys))
            )

    @contextmanager
    def _connect(self, shard: str) -> Iterator[Connection]:
        self._write_waiting()
        with self._db_lock, self._engine(shard).connect() as connection, connection.begin():
            yield connection

    def _engine(self, shard: str) -> Engine:
        engine = self._engines.get(shard)
        if engine is not None and not Path(self.path_for_shard(shard)).exists():  # a run that was wiped
            engine.dispose()
            engine = None
        if engine is None:
            self._engines[shard] = engine = _open(self.conn_string_for_shard(shard))
            self._initdb(engine)
            while len(self._engines) > _FILES_OPEN:
                self._engines.popitem(last=False)[1].dispose()
        self._engines.move_to_end(shard)
        return engine


def _kind(event: EventLogEntry) -> DagsterEventType | None:
    return event.dagster_event.event_type if event.dagster_event is not None else None


def _open(address: str) -> Engine:
    engine = create_engine(address, connect_args={"timeout": _WAIT_FOR_OTHERS_S})
    pack_events_of(engine)

    @event.listens_for(engine, "connect")
    def set_up(connection: Any, _record: Any) -> None:
        connection.execute("PRAGMA synchronous = NORMAL")

    return engine
