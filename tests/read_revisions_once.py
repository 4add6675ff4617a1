"""Alembic's revisions of Dagster's tables, read once for all the roots that a process opens.

Each root has databases of its own, and each time one is opened Alembic would read its 60 revisions again: a quarter
of a second, a thousand times over.
"""

from __future__ import annotations

from alembic.config import Config
from alembic.script import ScriptDirectory

_READ: dict[str | None, ScriptDirectory] = {}
_read = ScriptDirectory.from_config


def _read_once(config: Config) -> ScriptDirectory:
    folder = config.get_main_option("script_location")
    if folder not in _READ:
        _READ[folder] = _read(config)
    return _READ[folder]


ScriptDirectory.from_config = _read_once
