"""Provenance of a stage's result: inputs, settings, code, and outcome.

Belongs here: the fingerprint of a stage (code, settings, inputs) and the outcome record stored beside the artefacts.
Does not belong here: deciding what to run (:mod:`trace_dag.flow`).

A result is current while its fingerprint is: the same version of the stage's code, the same versions of the libraries
that decide, the same section of settings, the same bytes as input. The record of an outcome is written after the
artefacts it lists, so a record means that they are complete; their sizes show whether they still are.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cache
from importlib import metadata
from typing import Any, Final

from pydantic import BaseModel, TypeAdapter, ValidationError

from trace_dag.common.errors import DamagedFile, Reason
from trace_dag.common.plugins import Plugin, PluginKind, plugin
from trace_dag.common.stage import Stage
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import StoredFile

LIBRARIES: Final = ("lxml", "mujoco", "numpy", "osmium", "pyarrow", "pyproj", "scipy", "shapely")
"""Those whose versions decide what comes out: a result made with others is made again."""
_HISTORY_KEPT = 20
MADE_AGAIN = "trace-dag run makes it again"


class Outcome(StrEnum):
    """Outcomes of a stage for one crash.

    ``STARTED`` replaces an older record while its artefacts are replaced.
    """

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    FAILED = "failed"
    STARTED = "started"


@dataclass(frozen=True)
class Provenance:
    """Everything a stage's result depends on.

    ``code`` is the number of its code (:attr:`trace_dag.flow.contract.StageDefinition.version`), ``inputs`` maps
    artefact names to SHA-256, ``libraries`` maps libraries to versions.
    """

    code: str
    settings: dict[str, Any]
    inputs: dict[str, str]
    libraries: dict[str, str] = field(default_factory=dict)

    @property
    def fingerprint(self) -> str:
        """Return the SHA-256 (hexadecimal) over all of it."""
        parts = {
            "code": self.code,
            "settings": self.settings,
            "inputs": self.inputs,
            "libraries": self.libraries,
        }  # by hand: asdict copies all of it, and a year has 250,000
        return hashlib.sha256(json.dumps(parts, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

    def changed_to(self, other: Provenance) -> tuple[str, ...]:
        """Return the names of the differences between the two.

        Examples: "code", "setting radius_m", "input maps", "library numpy".
        """
        found = ["code"] if self.code != other.code else []
        for what, before, after in (
            ("setting", self.settings, other.settings),
            ("input", self.inputs, other.inputs),
            ("library", self.libraries, other.libraries),
        ):
            names = sorted(before.keys() | after.keys())
            found += [f"{what} {name}" for name in names if before.get(name) != after.get(name)]
        return tuple(found)


@dataclass(frozen=True)
class EarlierOutcome:
    """The contents of a record before it was replaced."""

    run_id: str
    started_at: str
    outcome: Outcome
    reason: Reason | None
    fingerprint: str
    detail: str = ""


@dataclass(frozen=True)
class FailedAttempt:
    """An attempt to make a result anew that failed. ``error`` is its traceback."""

    run_id: str
    started_at: str
    detail: str
    error: str
    transient: bool
    attempts: int


@dataclass(frozen=True)
class OutcomeRecord:
    """The result of one stage for one crash, as stored at ``ROOT/<stage>/<key>.outcome.json``.

    ``started_at`` is ISO 8601 in UTC; ``measured`` and ``threshold`` are in the unit ``detail`` states; ``figures`` are
    the few numbers a person looks at first; ``error`` is the traceback of a failure. ``pictures`` show the crash after
    this outcome, if it was its last. With a ``failed_attempt`` the result is outdated: an attempt to make it anew
    failed, and it is kept until one succeeds.
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
    pictures: tuple[StoredFile, ...] = ()
    figures: dict[str, str | float | int | bool | None] = field(default_factory=dict)
    error: str = ""
    transient: bool = False
    attempts: int = 1
    failed_attempt: FailedAttempt | None = None
    history: tuple[EarlierOutcome, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of the record's file below the storage root."""
        return record_name(self.stage, self.key)

    def artefact(self, extension: str) -> StoredFile | None:
        """Return the artefact with that extension (``xodr``), if the stage made one."""
        wanted = artefact_name(self.stage, self.key, extension)
        return next((artefact for artefact in self.artefacts if artefact.name == wanted), None)

    def picture(self, extension: str) -> StoredFile | None:
        """Return the picture with that extension (``png``), if one was drawn."""
        return next((file for file in self.pictures if file.name.endswith(f".{extension}")), None)

    def begun_again(self) -> OutcomeRecord:
        """Return this record in the state ``STARTED``, while its artefacts are replaced.

        It lists no artefacts, and its stage has to run.
        """
        begun = replace(self, outcome=Outcome.STARTED, artefacts=(), pictures=(), fingerprint="", failed_attempt=None)
        return begun.superseding(self)

    def outlasting(self, failed: OutcomeRecord) -> OutcomeRecord:
        """Return this record with a failed attempt to make its result anew."""
        attempt = FailedAttempt(
            failed.run_id, failed.started_at, failed.detail, failed.error, failed.transient, failed.attempts
        )
        return replace(self, failed_attempt=attempt)

    def superseding(self, earlier: OutcomeRecord | None) -> OutcomeRecord:
        """Return this record with the history of the one it replaces, limited to the latest twenty."""
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
        if (attempt := earlier.failed_attempt) is not None:
            failed = EarlierOutcome(attempt.run_id, attempt.started_at, Outcome.FAILED, None, "", attempt.detail)
            history = (*history, failed)
        return replace(self, history=history[-_HISTORY_KEPT:])


_RECORDS = TypeAdapter(OutcomeRecord)


def record_name(stage: Stage, key: str) -> str:
    """Return the path of a stage's outcome, below the storage root."""
    return f"{stage}/{key}.outcome.json"


def crash_of(name: str) -> str:
    """Return the crash key in a stored file's name; another word if the file belongs to no crash.

    >>> crash_of("road_map/2023-319003.rejected.json")
    '2023-319003'
    """
    return name.rpartition("/")[2].partition(".")[0]


def artefact_name(stage: Stage, key: str, extension: str) -> str:
    """Return the path of an artefact of a stage, below the storage root."""
    return f"{stage}/{key}.{extension}"


def record_to_json(record: OutcomeRecord) -> bytes:
    """Return the record as stored, with its checksum."""
    return add_checksum(_RECORDS.dump_json(record))


def record_from_json(data: bytes, *, name: str) -> OutcomeRecord:
    """Return a stored record.

    Raises :class:`DamagedFile` if it is invalid, or belongs to another stage or crash.
    """
    try:
        record = _RECORDS.validate_python(check_document(data, name=name))
    except ValidationError as error:
        raise DamagedFile(name, f"not an outcome record ({error.errors()[0]['msg']})", MADE_AGAIN) from error
    except DamagedFile as damaged:
        raise damaged.mended_by(MADE_AGAIN) from damaged
    if record.name != name:
        raise DamagedFile(name, f"the outcome record of {record.name}", MADE_AGAIN)
    return record


def now() -> str:
    """Return the present moment, ISO 8601 in UTC, milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def settings_of(section: BaseModel | None) -> dict[str, Any]:
    """Return a section of settings for provenance, as JSON values, without fields that affect no result.

    These are fields that only say how to reach a service, declared with ``json_schema_extra={"provenance": False}``,
    and fields that matter only for a certain value of another field, ``{"provenance": {"estimator": "llm"}}``.
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


def libraries_of(section: BaseModel | None) -> dict[str, str]:
    """Return versions of the libraries that affect results.

    These are :data:`LIBRARIES` and the packages of chosen third-party plugins.
    """
    plugins = {each.package: each.version for each in chosen_plugins(section) if not each.is_ours}
    return {**_library_versions(), **plugins}


@cache
def _library_versions() -> dict[str, str]:
    return {name: metadata.version(name) for name in LIBRARIES}


def chosen_plugins(section: BaseModel | None) -> tuple[Plugin, ...]:
    """Return the plugins that a section of settings chooses.

    Their fields are declared with ``json_schema_extra={"plugin": kind}``.
    """
    chosen = []
    for name, info in type(section).model_fields.items() if section is not None else ():
        declared = info.json_schema_extra.get("plugin") if isinstance(info.json_schema_extra, dict) else None
        if isinstance(declared, PluginKind):
            chosen.append(plugin(declared, getattr(section, name)))
    return tuple(chosen)


def combine_digests(parts: Mapping[str, str]) -> str:
    """Return one SHA-256 for several named digests, independent of their order."""
    return hashlib.sha256(json.dumps(dict(parts), sort_keys=True).encode()).hexdigest()
