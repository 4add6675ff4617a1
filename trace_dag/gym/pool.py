"""The crashes of an environment, loaded when first driven, once for all environments of a process."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from weakref import WeakKeyDictionary

from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.stored_cases import case_of, likely_courses, somebody_met, stored_variations, verified_cases
from trace_dag.agents.stored_traffic import load_driven
from trace_dag.common.errors import UserError
from trace_dag.common.settings import SimSettings
from trace_dag.flow.artefacts import CrashArtefacts
from trace_dag.gym.spaces import LanePoints
from trace_dag.reading.crashes import Crashes, Home
from trace_dag.reading.opening import open_place
from trace_dag.scenario.cases import Case
from trace_dag.simulation.run import backend
from trace_dag.simulation.types import Simulation

Place = str | os.PathLike[str] | Crashes


LOADED_AT_ONCE = 64
"""So many cases stay loaded, the ones driven last: a map takes megabytes, and a release has hundreds."""


@dataclass(frozen=True, eq=False)
class Loaded:
    """A case ready for runs: read, and its map loaded in the simulator.

    No run changes it, so environments share it.
    """

    case: Case
    simulation: Simulation
    lanes: LanePoints


@dataclass(frozen=True, eq=False)
class Track:
    """A case to drive in.

    ``load`` reads it, ``crash`` is the stored crash, ``weight`` that of a likely course among those of its crash. All
    environments have the same tracks of one opened place.
    """

    case_id: str
    crash: CrashArtefacts
    load: Callable[[], Case]
    settings: SimSettings
    weight: float = 1.0

    @property
    def key(self) -> str:
        """Return the crash's key."""
        return self.crash.key

    @property
    def loaded(self) -> Loaded:
        """Return the loaded case; it is loaded again if too many others were driven since."""
        return _loaded(self)

    @property
    def case(self) -> Case:
        """Return the case."""
        return self.loaded.case

    @property
    def simulation(self) -> Simulation:
        """Return the simulator."""
        return self.loaded.simulation

    @property
    def lanes(self) -> LanePoints:
        """Return the lanes of its map."""
        return self.loaded.lanes


@lru_cache(maxsize=LOADED_AT_ONCE)
def _loaded(track: Track) -> Loaded:
    case = track.load()
    simulation = backend(track.settings).load(case.network, case.xodr, friction=case.friction)
    return Loaded(case, simulation, LanePoints(case.network))


_known: WeakKeyDictionary[Crashes, dict[tuple[str, bool], Track]] = WeakKeyDictionary()
"""The tracks made of each opened place. A place given by name is opened anew for each environment."""


def tracks(
    home: Place | None, keys: Sequence[str], *, variations: bool, courses: bool, traffic: Traffic = Traffic.RECORDED
) -> dict[str, Track]:
    """Return the verified crashes of a place in which two parties met, all or those of ``keys``, by case id.

    ``variations``: also the stored variations of each; ``courses``: the likely courses in place of each crash. Only a
    root has these. Raises :class:`UserError` if there are none.
    """
    crashes = home if isinstance(home, Crashes) else open_place(home)
    if isinstance(crashes, Home):
        found = _of_root(crashes, keys, variations, courses, traffic)
    elif variations or courses or traffic is Traffic.SURROUNDING:
        what = "variations, courses and surrounding traffic"
        raise UserError(f"{crashes.place}: {what} are of a root; this is a package or a release")
    else:
        settings, stored = SimSettings(), [crashes[key].stored for key in keys or crashes]
        found = [
            Track(crash.key, crash, partial(case_of, crash, settings), settings)
            for crash in stored
            if somebody_met(crash)
        ]
    if not found:
        raise UserError(f"{crashes.place}: no crash in which anybody met somebody; an agent has nobody to react to")
    shared = _known.setdefault(crashes, {})
    among = traffic is Traffic.SURROUNDING
    return {track.case_id: shared.setdefault((track.case_id, among), track) for track in found}


def _of_root(home: Home, keys: Sequence[str], variations: bool, courses: bool, traffic: Traffic) -> list[Track]:
    crashes = verified_cases(home.workspace, None, keys)
    cases = likely_courses(crashes) if courses else list(crashes)
    if variations:
        cases += stored_variations(home.workspace, crashes)
    settings = home.workspace.settings.sim
    return [
        Track(each.case_id, each.files, partial(load_driven, each, traffic), settings, each.weight) for each in cases
    ]
