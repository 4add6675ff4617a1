"""What a flow is made of: stages, each a function from stored artefacts to new ones.

Belongs here: the contract between the runner and the stage functions. The functions of the seven real stages are in
:mod:`trace_dag.pipeline.stages`; a test may hand the runner a flow of its own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from pydantic import BaseModel

from trace_dag.errors import Failure, Rejection, Stage
from trace_dag.pipeline.registry import CrashSource
from trace_dag.provenance import OutcomeRecord, artefact_name
from trace_dag.settings import Settings
from trace_dag.storage import Storage, StoredFile

T = TypeVar("T")
Figure = str | float | int | bool | None


@dataclass(frozen=True)
class StageProduct:
    """What a stage made: contents by file extension, and the few figures a person looks at first.

    A crash can be rejected and still leave artefacts to look at (a log without a collision, a negative verdict): then
    ``rejection`` says why. Without artefacts a stage raises the :class:`Rejection` instead. ``parsed`` holds, by
    extension, what the artefact's reader would make of it, where the stage has read it back already.
    """

    files: Mapping[str, bytes]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    rejection: Rejection | None = None
    parsed: Mapping[str, object] = field(default_factory=dict)


class DamagedArtefactError(Exception):
    """A stored artefact is not what its record says; the stage that made it has to run again."""

    def __init__(self, stage: Stage, file: StoredFile, found: str) -> None:
        super().__init__(f"{file.name}: {found}, recorded were {file.size} bytes with SHA-256 {file.sha256[:12]}")
        self.stage = stage


class CrashFiles:
    """One crash as a stage function sees it: its key, source, settings, and the artefacts of earlier stages.

    ``run_id`` is the run it is worked on in, "" where it is only looked at. Artefacts are read from storage when first
    asked for, checked against their record, and kept, parsed too, for the later stages of the same crash.
    """

    def __init__(
        self, key: str, source: CrashSource, settings: Settings, storage: Storage, *, run_id: str = ""
    ) -> None:
        self.key = key
        self.source = source
        self.settings = settings
        self.storage = storage
        self.run_id = run_id
        self._records: dict[Stage, OutcomeRecord] = {}
        self._contents: dict[str, bytes] = {}
        self._parsed: dict[str, Any] = {}

    def accept(
        self,
        record: OutcomeRecord,
        contents: Mapping[str, bytes] | None = None,
        parsed: Mapping[str, object] | None = None,
    ) -> None:
        """Take over the outcome of a stage, with its artefacts by name, as bytes and parsed, where they are at hand."""
        self._records[record.stage] = record
        stale = f"{record.stage}/"
        self._contents = {name: data for name, data in self._contents.items() if not name.startswith(stale)}
        self._parsed = {name: value for name, value in self._parsed.items() if not name.startswith(stale)}
        self._contents.update(contents or {})
        self._parsed.update(parsed or {})

    def has(self, stage: Stage, extension: str) -> bool:
        """Whether a stage left such an artefact."""
        record = self._records.get(stage)
        return record is not None and record.artefact(extension) is not None

    def outcome(self, stage: Stage) -> OutcomeRecord | None:
        """The outcome of an earlier stage, if it has one."""
        return self._records.get(stage)

    def figures(self, stage: Stage) -> Mapping[str, Figure]:
        """The figures an earlier stage recorded: enough to arrange work by, without reading its artefacts."""
        return self._records[stage].figures

    def read(self, stage: Stage, extension: str) -> bytes:
        """Content of an artefact of an earlier stage. Raises :class:`DamagedArtefactError`."""
        name = artefact_name(stage, self.key, extension)
        if name not in self._contents:
            file = self._records[stage].artefact(extension)
            if file is None:
                raise KeyError(name)
            self._contents[name] = self._checked(stage, file)
        return self._contents[name]

    def parsed(self, stage: Stage, extension: str, parse: Callable[[bytes], T]) -> T:
        """An artefact as ``parse`` reads it, parsed once per crash: each artefact has one reader."""
        name = artefact_name(stage, self.key, extension)
        if name not in self._parsed:
            self._parsed[name] = parse(self.read(stage, extension))
        value: T = self._parsed[name]
        return value

    def _checked(self, stage: Stage, file: StoredFile) -> bytes:
        found = ""
        for _ in range(2):  # what was cut short on its way is whole the second time
            try:
                data = self.storage.read(file.name)
            except FileNotFoundError as error:
                raise DamagedArtefactError(stage, file, "not there") from error
            if len(data) == file.size and hashlib.sha256(data).hexdigest() == file.sha256:
                return data
            found = f"{len(data)} other bytes"
        raise DamagedArtefactError(stage, file, found)


class StageFunction(Protocol):
    """Makes one stage for one crash; raises :class:`Rejection` or :class:`trace_dag.errors.Failure`."""

    def __call__(self, crash: CrashFiles, /) -> StageProduct:
        """The product of the stage."""


class BatchStageFunction(Protocol):
    """Makes one stage for several crashes at once, where that is cheaper; every key must be answered.

    What breaks for one crash alone is answered with the :class:`Failure`; what breaks for all is raised.
    """

    def __call__(self, crashes: Sequence[CrashFiles], /) -> Mapping[str, StageProduct | Rejection | Failure]:
        """Products, rejections or failures by key."""


class Grouping(Protocol):
    """Divides crashes into the groups a :class:`BatchStageFunction` is best called with."""

    def __call__(self, crashes: Sequence[CrashFiles], /) -> Sequence[Sequence[str]]:
        """Groups of keys, together all of them."""


class Requirement(Protocol):
    """Raises :class:`trace_dag.errors.UserError` where this machine lacks what the settings ask of a stage."""

    def __call__(self, settings: Settings, /) -> None:
        """Nothing where all is there."""


@dataclass(frozen=True)
class StageDefinition:
    """One stage: its function and everything its result depends on.

    ``inputs`` are artefacts of earlier stages by stage and extension; ``from_source`` says whether the report or the
    maps outside the storage enter; ``settings`` picks the section that matters; ``code`` names the modules whose
    sources, with all they import, make up its code version. ``requires`` is asked once before a run, so that what no
    crash could be done without is said once and before any is worked on.
    """

    stage: Stage
    function: StageFunction | None = None
    batch_function: BatchStageFunction | None = None
    grouping: Grouping | None = None
    inputs: tuple[tuple[Stage, str], ...] = ()
    from_source: tuple[str, ...] = ()  # "report", "maps"
    settings: str | None = None  # name of the section
    code: tuple[str, ...] = ()
    requires: Requirement | None = None

    def __post_init__(self) -> None:
        if (self.function is None) == (self.batch_function is None):
            raise ValueError(f"{self.stage}: a stage has either a function or a batch function")

    def section(self, settings: Settings) -> BaseModel | None:
        """The section of settings this stage depends on."""
        return None if self.settings is None else getattr(settings, self.settings)


class PictureFunction(Protocol):
    """Draws what is known of a crash: files by extension, none where nothing can be drawn yet."""

    def __call__(self, crash: CrashFiles, /) -> Mapping[str, bytes]:
        """The picture as ``png``, as ``webp`` small enough for an event log, and a sketch as ``svg``."""


@dataclass(frozen=True)
class Flow:
    """The stages in order, and what draws a crash."""

    stages: tuple[StageDefinition, ...]
    picture: PictureFunction | None = None

    def __post_init__(self) -> None:
        positions = [definition.stage.position for definition in self.stages]
        if positions != sorted(set(positions)):
            raise ValueError("the stages of a flow stand in the order of the flow, each once")

    def definition(self, stage: Stage) -> StageDefinition:
        """The definition of a stage."""
        return next(definition for definition in self.stages if definition.stage is stage)

    def segments(self, stages: Sequence[Stage]) -> list[tuple[StageDefinition, ...]]:
        """Selected stages cut into runs that one worker does for one crash at a time, batch stages by themselves."""
        segments: list[list[StageDefinition]] = []
        for definition in self.stages:
            if definition.stage not in stages:
                continue
            alone = definition.batch_function is not None
            if alone or not segments or segments[-1][-1].batch_function is not None:
                segments.append([definition])
            else:
                segments[-1].append(definition)
        return [tuple(segment) for segment in segments]
