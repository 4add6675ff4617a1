"""Logs: one line per message on standard error, as text or as JSON, naming the crash and stage.

``TRACE_DAG_LOG`` is the level of our own messages (default WARNING); of the libraries only warnings are logged, since
below that they tell of migrations and requests. ``TRACE_DAG_LOG_FORMAT=json`` writes one JSON object per line with
``time``, ``level``, ``logger``, ``message``, ``crash`` and ``stage`` where there is one, its figures, and ``error``
with the traceback; then nothing else goes to standard error, no progress bar and no plain line (:func:`print_problem`).
Both hold for worker processes too, which inherit them.

Belongs here: format and context. Does not belong here: what is worth logging.
"""

from __future__ import annotations

import io
import json
import logging
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Final, TextIO

from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import printable

LEVEL_VARIABLE: Final = "TRACE_DAG_LOG"
FORMAT_VARIABLE: Final = "TRACE_DAG_LOG_FORMAT"
_LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
_FORMATS = ("text", "json")

log = logging.getLogger("trace_dag")
_AT_WORK: ContextVar[tuple[str, str]] = ContextVar("at_work", default=("", ""))


@contextmanager
def log_context(crash: str, stage: str) -> Iterator[None]:
    """Name this crash and stage in every message logged inside."""
    token = _AT_WORK.set((crash, stage))
    try:
        yield
    finally:
        _AT_WORK.reset(token)


def figures(**values: object) -> Mapping[str, object]:
    """Return figures of a message for ``extra=``: members in a JSON line, omitted from text."""
    return {"figures": values}


def configure_logging() -> None:
    """Set up logging of this process from the environment. Raises :class:`UserError` for invalid variables."""
    level = (os.environ.get(LEVEL_VARIABLE) or "WARNING").upper()
    style = (os.environ.get(FORMAT_VARIABLE) or "text").lower()
    for variable, value, known in ((LEVEL_VARIABLE, level, _LEVELS), (FORMAT_VARIABLE, style, _FORMATS)):
        if value not in known:
            raise UserError(f"{variable}={value}: expected one of {', '.join(known)}")
    handler = logging.StreamHandler(own_stderr())
    handler.setFormatter(_JsonLines() if style == "json" else _Text("%(levelname)s %(message)s"))
    logging.basicConfig(level=max(logging.getLevelName(level), logging.WARNING), handlers=[handler])
    log.setLevel(level)
    logging.captureWarnings(style == "json")


def own_stderr() -> TextIO:
    """Return standard error through a separate descriptor.

    It stays the terminal while Dagster redirects 1 and 2 to a file.
    """
    try:
        return os.fdopen(os.dup(sys.stderr.fileno()), "w", buffering=1)
    except (OSError, io.UnsupportedOperation):  # something that a program has put in its place
        return sys.stderr


def writes_json() -> bool:
    """Return whether standard error may only contain JSON lines."""
    return (os.environ.get(FORMAT_VARIABLE) or "text").lower() == "json"


def print_problem(line: str, *, level: int = logging.ERROR) -> None:
    """Print a line of a command to standard error, or log it if standard error is JSON."""
    if writes_json():
        log.log(level, "%s", line)
    else:
        sys.stderr.write(f"{printable(line)}\n")


class _Text(logging.Formatter):
    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - its name in the standard library
        crash, stage = _AT_WORK.get()
        message = printable(super().formatMessage(record))
        return f"{message} [{crash} {stage}]" if crash and crash not in message else message


class _JsonLines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        crash, stage = _AT_WORK.get()
        line: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
        }
        if crash:
            line |= {"crash": crash, "stage": stage}
        line |= getattr(record, "figures", {})
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)
