"""What a stage's result was made from, and what came of it.

Belongs here: the fingerprint of a stage (code, settings, inputs) and the outcome record stored beside the artefacts.
Does not belong here: deciding what to run (:mod:`trace_dag.pipeline`).

A result is current while its fingerprint is: the same source code of everything the stage depends on, the same
section of settings, the same bytes as input. The record of an outcome is written after the artefacts it lists, so a
record means that they are complete; a look at their sizes tells whether they still are.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from trace_dag import __version__
from trace_dag.errors import Failure, Reason, Stage
from trace_dag.storage import StoredFile

_PACKAGE = Path(__file__).resolve().parent
# How work is stored, scheduled, shown and fetched does not change what comes out; settings enter by value.
_NOT_PART_OF_ANY_RESULT = (
    "trace_dag.pipeline",
    "trace_dag.storage",
    "trace_dag.provenance",
    "trace_dag.settings",
    "trace_dag.http",
    "trace_dag.turns",
)
_HISTORY_KEPT = 20


class Outcome(StrEnum):
    """How a stage ended for one crash. ``STARTED`` replaces an older record while its artefacts are replaced."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    FAILED = "failed"
    STARTED = "started"


@dataclass(frozen=True)
class Provenance:
    """Everything a stage's result depends on. ``inputs`` maps artefact names to SHA-256."""

    code: str
    settings: dict[str, Any]
    inputs: dict[str, str]

    @property
    def fingerprint(self) -> str:
        """SHA-256 (hexadecimal) over all of it."""
        parts = {"code": self.code, "settings": self.settings, "inputs": self.inputs}
        return hashlib.sha256(json.dumps(parts, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@dataclass(frozen=True)
class EarlierOutcome:
    """What a record said before it was replaced."""

    run_id: str
    started_at: str
    outcome: Outcome
    reason: Reason | None
    fingerprint: str
    detail: str = ""


@dataclass(frozen=True)
class OutcomeRecord:
    """The result of one stage for one crash, as stored at ``ROOT/<stage>/<key>.outcome.json``.

    ``started_at`` is ISO 8601 in UTC; ``measured`` and ``threshold`` are in the unit ``detail`` states; ``figures``
    are the few numbers a person looks at first; ``error`` is the traceback of a failure.
    """

    key: str
    stage: Stage
    outcome: Outcome
    provenance: Provenance
    fingerprint: str
    run_id: str
    started_at: str
    duration_s: float = 0.0
    reason: Reason | None = None
    detail: str = ""
    measured: float | None = None
    threshold: float | None = None
    artefacts: tuple[StoredFile, ...] = ()
    figures: dict[str, str | float | int | bool | None] = field(default_factory=dict)
    error: str = ""
    transient: bool = False
    attempts: int = 1
    history: tuple[EarlierOutcome, ...] = ()

    @property
    def name(self) -> str:
        """Name of the record's file below the storage root."""
        return record_name(self.stage, self.key)

    def artefact(self, extension: str) -> StoredFile | None:
        """The artefact with that extension (``xodr``), if the stage made one."""
        wanted = artefact_name(self.stage, self.key, extension)
        return next((artefact for artefact in self.artefacts if artefact.name == wanted), None)

    def begun_again(self) -> OutcomeRecord:
        """This record as it stands while its artefacts are made anew: it lists none, and its stage has to run."""
        return replace(self, outcome=Outcome.STARTED, artefacts=(), fingerprint="").superseding(self)

    def superseding(self, earlier: OutcomeRecord | None) -> OutcomeRecord:
        """This record with the history of the one it replaces, at most the latest twenty."""
        if earlier is None:
            return self
        history = earlier.history
        if earlier.outcome is not Outcome.STARTED:
            past = EarlierOutcome(
                run_id=earlier.run_id,
                started_at=earlier.started_at,
                outcome=earlier.outcome,
                reason=earlier.reason,
                fingerprint=earlier.fingerprint,
                detail=earlier.detail,
            )
            history = (*history, past)
        return replace(self, history=history[-_HISTORY_KEPT:])


_RECORDS = TypeAdapter(OutcomeRecord)


def record_name(stage: Stage, key: str) -> str:
    """Where the outcome of a stage is recorded, below the storage root."""
    return f"{stage}/{key}.outcome.json"


def artefact_name(stage: Stage, key: str, extension: str) -> str:
    """Where an artefact of a stage lies, below the storage root."""
    return f"{stage}/{key}.{extension}"


def record_to_json(record: OutcomeRecord) -> bytes:
    """The record as stored."""
    return _RECORDS.dump_json(record, indent=1)


def record_from_json(data: bytes, *, name: str) -> OutcomeRecord:
    """A stored record; :class:`Failure` if it is not one, or that of another stage or crash."""
    try:
        record = _RECORDS.validate_json(data)
    except ValidationError as error:
        raise Failure(f"{name}: not an outcome record ({error.errors()[0]['msg']}); run the crash again") from error
    if record.name != name:
        raise Failure(f"{name}: the outcome record of {record.name}; run the crash again")
    return record


def now() -> str:
    """The present moment, ISO 8601 in UTC, milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def settings_of(section: BaseModel | None) -> dict[str, Any]:
    """A section of settings as provenance holds it: JSON values, without fields on which nothing made depends.

    Those are the ones that only say how to reach a service, declared with ``json_schema_extra={"provenance": False}``,
    and the ones that matter only where another field has a certain value, ``{"provenance": {"estimator": "llm"}}``.
    """
    if section is None:
        return {}
    outside = set()
    for name, info in type(section).model_fields.items():
        counts = info.json_schema_extra.get("provenance") if isinstance(info.json_schema_extra, dict) else None
        if counts is False or (
            isinstance(counts, dict) and any(getattr(section, other) != value for other, value in counts.items())
        ):
            outside.add(name)
    return section.model_dump(mode="json", exclude=outside)


def combined_digest(parts: Mapping[str, str]) -> str:
    """One SHA-256 for several named digests, whatever their order."""
    return hashlib.sha256(json.dumps(dict(parts), sort_keys=True).encode()).hexdigest()


# --- code ------------------------------------------------------------------------------------------------------
@cache
def code_version(modules: tuple[str, ...]) -> str:
    """Version of the code behind some modules of this package: ``0.1.0+<digest of their sources>``.

    The digest covers every module of the package they import, directly or not, inside functions too, and the data
    files (code tables, prompts) beside those modules. So a change anywhere a stage depends on makes its results
    stale, and a change elsewhere does not.
    """
    digest = hashlib.sha256()
    folders = set()
    for module in sorted(_import_closure(modules)):
        path = _source_of(module)
        if path is None:
            continue
        digest.update(module.encode() + b"\0" + path.read_bytes() + b"\0")
        folders.add(path.parent)
    for folder in sorted(folders - {_PACKAGE}):
        for path in sorted(_data_files(folder)):
            digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{__version__}+{digest.hexdigest()[:16]}"


def _data_files(folder: Path) -> Iterable[Path]:
    for path in folder.iterdir():
        if path.is_file() and path.suffix not in (".py", ".pyc"):
            yield path
        elif path.is_dir() and path.name != "__pycache__" and not (path / "__init__.py").exists():
            yield from _data_files(path)


@cache
def _import_closure(modules: tuple[str, ...]) -> frozenset[str]:
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if module in found or module.startswith(_NOT_PART_OF_ANY_RESULT):
            continue
        found.add(module)
        waiting.extend(_imports_of(module))
        if "." in module:
            waiting.append(module.rpartition(".")[0])
    return frozenset(found)


@cache
def _imports_of(module: str) -> frozenset[str]:
    path = _source_of(module)
    if path is None or module == "trace_dag":
        return frozenset()
    imported = set()
    for node in ast.walk(ast.parse(path.read_bytes(), filename=str(path))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            imported.add(node.module)
            imported |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(name for name in imported if name.split(".")[0] == "trace_dag" and _source_of(name))


def _source_of(module: str) -> Path | None:
    """Source file of a module of this package, None if there is no such module."""
    base = _PACKAGE.joinpath(*module.split(".")[1:])
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    return None
