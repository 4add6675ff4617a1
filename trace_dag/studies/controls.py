"""Negative controls of a cohort: its verdicts against other crashes' reports, and with one party late, mirrored or
moved."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.errors import UserError
from trace_dag.flow.records import Complaint, raised
from trace_dag.flow.workspace import Workspace
from trace_dag.progress import Progress, silent
from trace_dag.settings import VerdictSettings
from trace_dag.studies.stored_crashes import judged_crashes
from trace_dag.studies.tables import CONTROLS, store
from trace_dag.verdict import departure_controls, strike_controls
from trace_dag.verdict.contact_controls import contact_controls, parked_moved
from trace_dag.verdict.controls import (
    ControlRow,
    JudgedCrash,
    Shift,
    against_other_reports,
    of_same_kind,
    renumbered,
    reports_differ,
    shifted_estimate,
    shifted_in_time,
    shifted_row,
    true_pairing,
)
from trace_dag.verdict.departure_controls import departures_differ, mirrored_departure, object_moved
from trace_dag.verdict.strike_controls import late_person, mirrored, strikes_differ

_OF_TWO = (Reconstruction.COLLISION, Reconstruction.STRIKES)
"""Whose reports are set beside a collision of two vehicles, where two vehicles met: after a person was struck, too."""


def negative_controls(
    workspace: Workspace,
    cohort: str,
    *,
    most: int,
    tell: Progress = silent,
    complain: Complaint = raised,
) -> list[ControlRow]:
    """Every judged crash of a cohort against its own report, every verified one against every other's report of its
    kind and with one vehicle late; of a crash with people the person late, and from the other side; of a vehicle that
    leaves the road the side mirrored, and the object moved. Stored for the warehouse.

    Each crash meets every other, so a cohort with more than ``most`` verdicts is represented by so many of them, drawn
    at random. ``tell`` hears how many of how many are read, and then judged; ``complain`` of those left out.

    Raises :class:`UserError` for a cohort that is not registered or has no verdicts yet.
    """
    from trace_dag.sim.embedded import EmbeddedBackend
    from trace_dag.sim.run import simulate

    crashes = judged_crashes(workspace, workspace.registry.keys(cohort), most=most, tell=tell, complain=complain)
    if not crashes:
        raise UserError(f"no crash of cohort {cohort!r} has a verdict yet; trace-dag run --cohort {cohort} makes them")
    settings = workspace.settings
    kinds = {crash.judged.record.key: crash.judged.record.kind.value for crash in crashes}
    rows = [true_pairing(crash.judged, settings.verdict) for crash in crashes]
    verified = [crash.judged for crash in crashes if crash.accepted]
    backend = EmbeddedBackend(settings.sim)

    def judged(crash: JudgedCrash, shift: Shift | None) -> ControlRow:
        log = None
        if shift is not None:
            states = shifted_estimate(crash, shift)
            (log,) = simulate(backend, crash.network, b"", states, settings.sim, record=crash.record)
        return shifted_row(crash, shift, log, settings.verdict)

    for done, crash in enumerate(verified, 1):
        rows += _of_crash(crash, verified, judged, settings.verdict)
        tell(done, len(verified))
    rows = [replace(row, crash_kind=kinds[row.key]) for row in rows]
    store(workspace, CONTROLS, cohort, rows)
    return rows


def _of_crash(
    crash: JudgedCrash,
    verified: list[JudgedCrash],
    judged: Callable[[JudgedCrash, Shift | None], ControlRow],
    settings: VerdictSettings,
) -> Iterator[ControlRow]:
    """The controls of one crash, by what it is reconstructed as; ``judged`` simulates one with a party moved."""
    reconstruction = reconstruction_of(crash.record)
    if reconstruction is Reconstruction.STRIKES:
        of_kind = of_same_kind(crash, verified)
        yield from against_other_reports(crash, of_kind, settings, strike_controls.in_place_of, strikes_differ)
        yield judged(crash, late_person(crash.hypothesis))
        other_side = mirrored(crash.record, crash.hypothesis)
        if other_side is not None:
            yield replace(judged(crash, other_side), kind="mirrored", shift_s=None)
        return
    if reconstruction in (Reconstruction.DEPARTURE, Reconstruction.OVERTURN):
        of_kind = of_same_kind(crash, verified)
        yield from against_other_reports(crash, of_kind, settings, departure_controls.in_place_of, departures_differ)
        for kind, changed in (("mirrored", mirrored_departure(crash)), ("object_moved", object_moved(crash, settings))):
            if changed is not None:
                yield replace(judged(crash, changed), kind=kind, shift_s=None)
        return
    if reconstruction is Reconstruction.CONTACTS:
        yield from contact_controls(crash, verified, settings)
        aside = parked_moved(crash)
        if aside is not None:
            yield replace(judged(crash, aside), kind="parked_moved", shift_s=None)
    else:
        pairs = (each for each in verified if reconstruction_of(each.record) in _OF_TWO)
        yield from against_other_reports(crash, pairs, settings, renumbered, reports_differ)
    yield judged(crash, shifted_in_time(crash.hypothesis))
