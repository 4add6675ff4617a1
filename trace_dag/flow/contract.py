"""The contract of a stage: a function of its inputs, and the files of a crash that it takes.

Belongs here: the contract between the runner and the stage functions. The functions of the seven real stages are in
:mod:`trace_dag.flow.stages`; a test may hand the runner a flow of its own.

Each parameter of a stage function is an input, chosen by its name:

* the name of an artefact, such as ``record`` (:mod:`trace_dag.flow.artefacts`): the artefact that an earlier stage
  made. If it is annotated ``| None``, it is None where that stage made none.
* ``report``, ``maps``, ``map_service``: the sources of the report and of the maps.
* ``settings``: the section of the settings that the annotation names.
* ``key``: the crash.
* ``services``: external services.

It returns a :class:`StageProduct`, or raises :class:`trace_dag.common.errors.Rejection` or
:class:`trace_dag.common.errors.Failure`.

A function that is annotated to return a ``Mapping`` computes several crashes in one call, for stages where that is
cheaper. Its inputs of single crashes are mappings by key, and it returns a product, rejection or failure for each key.

The inputs are read from the function's source, so that no module is loaded to find what a stage depends on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel

from trace_dag.common.errors import DamagedFile, Rejection
from trace_dag.common.plugins import resolve_reference, signature_of
from trace_dag.common.provenance import OutcomeRecord, artefact_name, libraries_of, settings_of
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.artefacts import ARTEFACTS, LOGS, VERDICT, Artefact
from trace_dag.flow.staleness import Recipe

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.registry import CrashSource
    from trace_dag.flow.cohorts.services import Services
    from trace_dag.simulation.types import SimulationLog

T = TypeVar("T")
_SECTIONS = {info.annotation.__name__: name for name, info in Settings.model_fields.items() if info.annotation}
_SOURCES = {"report": "report", "maps": "maps", "map_service": "maps"}  # parameter: what it is of a crash's sources
Figure = str | float | int | bool | None


class DamagedArtefactError(DamagedFile):
    """An artefact or picture that differs from its record; the stage that made it has to run again."""

    def __init__(self, key: str, stage: Stage, name: str, found: str) -> None:
        super().__init__(name, found, f"trace-dag run --only {key} --from {stage} makes it again")
        self.key = key
        self.stage = stage

    def __reduce__(self) -> tuple[object, ...]:
        return (DamagedArtefactError, (self.key, self.stage, self.name, self.found))


def read_artefact(storage: Storage, record: OutcomeRecord, file: StoredFile) -> bytes:
    """Return the content of one of the files a record lists.

    Raises :class:`DamagedArtefactError`.
    """
    try:
        return storage.read_whole(file)
    except DamagedFile as damaged:
        raise DamagedArtefactError(record.key, record.stage, file.name, damaged.found) from damaged


class CrashFiles:
    """One crash as a stage function sees it: its key, source, settings, and the artefacts of earlier stages.

    ``run_id`` is the current run, or "" if the crash is only read. Artefacts are read from storage on first use,
    checked against their record, and kept, also parsed, for later stages of the same crash.
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

    @classmethod
    def recorded(
        cls,
        key: str,
        source: CrashSource,
        settings: Settings,
        storage: Storage,
        records: Mapping[Stage, OutcomeRecord],
        *,
        run_id: str = "",
    ) -> CrashFiles:
        """Return a crash with the outcomes of its stages so far; nothing is read yet."""
        files = cls(key, source, settings, storage, run_id=run_id)
        for record in records.values():
            files.accept(record)
        return files

    def unread(self) -> CrashFiles:
        """Return the same crash with nothing read yet, so that work on many crashes releases memory."""
        return self.recorded(self.key, self.source, self.settings, self.storage, self._records, run_id=self.run_id)

    def accept(
        self,
        record: OutcomeRecord,
        contents: Mapping[str, bytes] | None = None,
        parsed: Mapping[str, object] | None = None,
    ) -> None:
        """Add the outcome of a stage, with its artefacts by name, as bytes or parsed, if they are at hand."""
        self._records[record.stage] = record
        stale = f"{record.stage}/"
        self._contents = {name: data for name, data in self._contents.items() if not name.startswith(stale)}
        self._parsed = {name: value for name, value in self._parsed.items() if not name.startswith(stale)}
        self._contents.update(contents or {})
        self._parsed.update(parsed or {})

    def amend(self, record: OutcomeRecord) -> None:
        """Replace a record by one with more information on the same artefacts."""
        self._records[record.stage] = record

    @property
    def services(self) -> Services:
        """Return the services of this crash's run."""
        from trace_dag.flow.cohorts.services import Services

        return Services(self.storage, self.settings.services, self.run_id)

    @property
    def records(self) -> dict[Stage, OutcomeRecord]:
        """Return the outcomes of its stages so far."""
        return self._records

    def has(self, artefact: Artefact[Any]) -> bool:
        """Return whether the artefact is stored."""
        record = self._records.get(artefact.stage)
        return record is not None and all(record.artefact(extension) for extension in artefact.extensions)

    def figures(self, stage: Stage) -> Mapping[str, Figure]:
        """Return the figures recorded by an earlier stage; they suffice to group work without reading artefacts."""
        return self._records[stage].figures

    def load(self, artefact: Artefact[T]) -> T:
        """Return an artefact from its reader, which runs once per crash.

        Raises :class:`DamagedArtefactError`.
        """
        contents = [self.read(artefact.stage, extension) for extension in artefact.extensions]
        if not artefact.reader:
            return contents[0]  # type: ignore[return-value] # an artefact without a reader is one of bytes
        name = artefact_name(artefact.stage, self.key, artefact.extensions[0])
        if name not in self._parsed:
            named = {"name": name.partition("/")[2]} if artefact.named else {}
            self._parsed[name] = resolve_reference(artefact.reader)(*contents, **named)
        value: T = self._parsed[name]
        return value

    def shown_log(self) -> SimulationLog | None:
        """Return the log that the verdict judges, or without a verdict the first one.

        None if nothing was simulated. Raises :class:`DamagedArtefactError`.
        """
        if not self.has(LOGS):
            return None
        return self.load(LOGS)[self.load(VERDICT).hypothesis if self.has(VERDICT) else 0]

    def read(self, stage: Stage, extension: str) -> bytes:
        """Return the content of one of the files of a stage.

        Raises :class:`DamagedArtefactError`.
        """
        name = artefact_name(stage, self.key, extension)
        if name not in self._contents:
            file = self._records[stage].artefact(extension)
            if file is None:
                found = "it is not there: another version of the program ran its stage"
                raise DamagedArtefactError(self.key, stage, name, found)
            self._contents[name] = read_artefact(self.storage, self._records[stage], file)
        return self._contents[name]

    def check(self) -> None:
        """Read every artefact once. Raises :class:`DamagedArtefactError`."""
        for record in self._records.values():
            for file in record.artefacts:
                read_artefact(self.storage, record, file)

    def stored(self, artefact: Artefact[Any]) -> StoredFile | None:
        """Return the (first) file of an artefact, or None."""
        record = self._records.get(artefact.stage)
        return record.artefact(artefact.extensions[0]) if record else None

    def picture(self, extension: str) -> StoredFile | None:
        """Return the picture of the crash in its present state, or None."""
        if not self._records:
            return None
        return self._records[max(self._records, key=lambda stage: stage.position)].picture(extension)


@dataclass(frozen=True)
class StageDefinition:
    """One stage. ``function`` makes it; all its dependencies are in its signature and code.

    ``version`` is the number of that code, raised if its results change, which makes them anew. ``grouping`` divides
    crashes, as :class:`CrashFiles`, into lists of keys, one for each call of a function for several crashes.
    ``requires`` is called with settings and services before a run with work for the stage, and raises
    :class:`trace_dag.common.errors.UserError` for a missing requirement of all crashes. Both are ``module:function``.
    """

    stage: Stage
    function: str
    version: int = 1
    grouping: str | None = None
    requires: str | None = None

    @property
    def for_several(self) -> bool:
        """Return whether the function makes the stage for several crashes at once."""
        return signature_of(self.function).returns.startswith("Mapping[")

    @property
    def sources(self) -> frozenset[str]:
        """Return the inputs from outside the storage: "report", "maps"."""
        names = (each.name for each in signature_of(self.function).parameters)
        return frozenset(_SOURCES[name] for name in names if name in _SOURCES)

    def section(self, settings: Settings) -> BaseModel | None:
        """Return the section of settings that the function asks for."""
        for parameter in signature_of(self.function).parameters:
            if parameter.name == "settings":
                section: BaseModel = getattr(settings, _SECTIONS[parameter.annotation])
                return section
        return None


@dataclass(frozen=True)
class Flow:
    """The stages in order, their artefacts by parameter, and the function that draws a crash.

    ``picture`` (``module:function``) takes the :class:`CrashFiles` of a crash and returns files by extension: ``png``
    the picture, ``svg`` a sketch; none if nothing can be drawn yet.
    """

    stages: tuple[StageDefinition, ...]
    artefacts: Mapping[str, Artefact[Any]] = field(default_factory=lambda: ARTEFACTS)
    picture: str | None = None

    def __post_init__(self) -> None:
        positions = [definition.stage.position for definition in self.stages]
        if positions != sorted(set(positions)):
            raise ValueError("the stages of a flow stand in the order of the flow, each once")

    def definition(self, stage: Stage) -> StageDefinition:
        """Return the definition of a stage."""
        return next(definition for definition in self.stages if definition.stage is stage)

    def inputs(self, definition: StageDefinition) -> dict[str, Artefact[Any]]:
        """Return the artefacts of earlier stages that a stage is made from, by parameter."""
        names = [each.name for each in signature_of(definition.function).parameters]
        return {name: self.artefacts[name] for name in names if name in self.artefacts}

    def recipes(self, settings: Settings) -> dict[Stage, Recipe]:
        """Return the recipe of each stage, in order."""
        return {each.stage: self._recipe(each, settings) for each in self.stages}

    def _recipe(self, definition: StageDefinition, settings: Settings) -> Recipe:
        section = definition.section(settings)
        return Recipe(
            str(definition.version),
            settings_of(section),
            libraries_of(section),
            definition.sources,
            tuple(
                (each.stage, extension) for each in self.inputs(definition).values() for extension in each.extensions
            ),
        )

    def make(self, definition: StageDefinition, crash: CrashFiles) -> StageProduct:
        """Return a stage made for one crash."""
        product: StageProduct = resolve_reference(definition.function)(**self._arguments(definition, crash))
        return product

    def make_for_several(
        self, definition: StageDefinition, crashes: Sequence[CrashFiles]
    ) -> Mapping[str, StageProduct | Rejection | Exception]:
        """Run a stage for several crashes at once; return products, rejections or failures by key."""
        arguments = {crash.key: self._arguments(definition, crash) for crash in crashes}
        of_crash = {*self.artefacts, *_SOURCES}
        given = {
            name: {key: each[name] for key, each in arguments.items()} if name in of_crash else value
            for name, value in arguments[crashes[0].key].items()
        }
        products: Mapping[str, StageProduct | Rejection | Exception] = resolve_reference(definition.function)(**given)
        return products

    def _arguments(self, definition: StageDefinition, crash: CrashFiles) -> dict[str, object]:
        at_hand = {
            "key": crash.key,
            "report": crash.source.report,
            "maps": crash.source.maps,
            "map_service": crash.source.map_service,
            "services": crash.services,
            "settings": definition.section(crash.settings),
        }
        given = {}
        for each in signature_of(definition.function).parameters:
            artefact = self.artefacts.get(each.name)
            if artefact is None:
                given[each.name] = at_hand[each.name]
            elif each.annotation.endswith("| None") and not crash.has(artefact):
                given[each.name] = None
            else:
                given[each.name] = crash.load(artefact)
        return given

    def segments(self, stages: Sequence[Stage]) -> list[tuple[StageDefinition, ...]]:
        """Return the selected stages as segments that run crash by crash.

        Each stage for several crashes is a segment of its own.
        """
        segments: list[list[StageDefinition]] = []
        for definition in self.stages:
            if definition.stage not in stages:
                continue
            if definition.for_several or not segments or segments[-1][-1].for_several:
                segments.append([definition])
            else:
                segments[-1].append(definition)
        return [tuple(segment) for segment in segments]


@dataclass(frozen=True)
class StageProduct:
    """The product of a stage: contents by file extension, and the main figures.

    A rejected crash can still have artefacts (a log without a collision, a negative verdict); ``rejection`` then has
    the reason. Without artefacts a stage raises the :class:`Rejection` instead. ``parsed`` has, by extension, the exact
    result of the artefact's reader, if the stage has it at hand.
    """

    files: Mapping[str, bytes]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    rejection: Rejection | None = None
    parsed: Mapping[str, object] = field(default_factory=dict)
