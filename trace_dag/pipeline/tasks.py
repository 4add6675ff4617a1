"""What travels to the workers and back: crashes and stages to run, and what each stage did.

Belongs here: these types, what a stage's result would be made from, and whether a stored one still holds. Does not
belong here: doing the work (:mod:`trace_dag.pipeline.worker`) or dividing it (:mod:`trace_dag.pipeline.batch`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from trace_dag.code_versions import CodeVersion
from trace_dag.errors import Stage
from trace_dag.pipeline.flow import Flow, StageDefinition
from trace_dag.pipeline.records import Records
from trace_dag.pipeline.registry import CrashSource
from trace_dag.provenance import Outcome, OutcomeRecord, Provenance, libraries_of, settings_of
from trace_dag.settings import Settings
from trace_dag.storage import Storage


class Action(StrEnum):
    """What a stage of a run did for a crash."""

    COMPUTED = "computed"
    UNCHANGED = "unchanged"  # its record is current
    NOT_REACHED = "not_reached"  # an earlier stage rejected the crash
    BLOCKED = "blocked"  # an earlier stage failed or has not run


@dataclass(frozen=True)
class StageEvent:
    """What one stage of a run did for one crash. ``record`` is the stage's own, or the earlier one that ended it.

    ``no_picture`` says, with the last event of a crash, why its picture could not be drawn.
    """

    key: str
    stage: Stage
    action: Action
    record: OutcomeRecord | None
    no_picture: str = ""

    @property
    def failed(self) -> bool:
        """Whether the crash stands failed at this stage after the run."""
        if self.action is Action.BLOCKED:
            return True
        return self.record is not None and self.record.outcome is Outcome.FAILED


@dataclass(frozen=True)
class Work:
    """What is the same for every chunk of a run; travels to the workers."""

    storage: Storage
    settings: Settings
    flow: Flow
    run_id: str
    code: Mapping[Stage, CodeVersion]
    force: frozenset[Stage] = frozenset()

    @staticmethod
    def code_versions(flow: Flow) -> dict[Stage, CodeVersion]:
        """Code version of every stage of a flow, as this process has it."""
        return {definition.stage: flow.code(definition) for definition in flow.stages}


@dataclass(frozen=True)
class CrashTask:
    """One crash to work on, with its records as they were when the task was made."""

    key: str
    source: CrashSource
    records: Records = field(default_factory=dict)


@dataclass(frozen=True)
class Chunk:
    """Some crashes and the stages to run for them. ``last``: no later chunk of this run goes on with them.

    ``again``: the chunk was with a worker that died; what it finished is in storage and is looked up.
    """

    work: Work
    crashes: tuple[CrashTask, ...]
    stages: tuple[Stage, ...]
    last: bool = True
    again: bool = False

    def split(self) -> list[Chunk]:
        """One chunk per crash, to be tried again."""
        return [replace(self, crashes=(crash,), again=True) for crash in self.crashes]


def provenance_of(
    definition: StageDefinition, work: Work, source: CrashSource, records: Mapping[Stage, OutcomeRecord]
) -> Provenance:
    """What the stage's result would be made from now."""
    inputs = {}
    if "report" in definition.sources:
        report = source.report
        inputs["report"] = report.sha256 or f"{report.kind}:{report.location}"
    if "maps" in definition.sources:
        inputs["maps"] = source.maps_digest
    for artefact in work.flow.inputs(definition).values():
        record = records.get(artefact.stage)
        for extension in artefact.extensions:
            file = record.artefact(extension) if record else None
            inputs[f"{artefact.stage}.{extension}"] = file.sha256 if file else ""
    code, section = work.code[definition.stage], definition.section(work.settings)
    return Provenance(code.digest, settings_of(section), inputs, libraries_of(code, section))


def is_current(record: OutcomeRecord | None, made_from: Provenance, whole: Mapping[str, bool]) -> bool:
    """Whether a stored outcome still holds: no failure, its artefacts whole, made from what it would be made from now.

    ``whole`` says of records by name whether their artefacts are, as :func:`trace_dag.pipeline.records.intact` finds.
    """
    if record is None or record.outcome not in (Outcome.ACCEPTED, Outcome.REJECTED):
        return False
    return whole.get(record.name, True) and record.fingerprint == made_from.fingerprint
