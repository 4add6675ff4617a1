"""Rejections, failures and errors of users, three kinds that are never mixed.

* :class:`Rejection`: the crash was examined and is excluded for a stated, measured reason. That is data.
* :class:`Failure` (and :class:`TransientFailure`): something of ours or of a service broke. That is retried.
* :class:`UserError`: the caller asked for something impossible; shown as one line, without a traceback.

Every reason a crash can be rejected for is declared here, once, with the stage that gives it and the category
of the published paper (TRACE, FSE Companion '26) it belongs to.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from trace_dag.common.stage import Stage


class PublishedCategory(StrEnum):
    """The paper's reasons for losing a report: 100 reports, 65 after the map stage, 52 verified."""

    VERTICAL_GEOMETRY = "vertical geometry"
    INCOMPLETE_INFORMATION = "incomplete information"
    INCONSISTENT_LOCATION = "inconsistent crash location"
    NOT_REPRODUCED = "not reproduced"
    NOT_IN_PAPER = "not in the paper"


class Reason(StrEnum):
    """Reasons of rejections.

    The value is the reason code in artefacts and tables.
    """

    NOT_RELEASED = "not_released"
    MALFORMED_REPORT = "malformed_report"
    INCOMPLETE_LOCATION = "incomplete_location"
    INCOMPLETE_TOPOLOGY = "incomplete_topology"
    INCOMPLETE_TRAJECTORY = "incomplete_trajectory"
    INCOMPLETE_IMPACT = "incomplete_impact"
    OUTSIDE_COHORT = "outside_cohort"
    NOT_MODELLED = "not_modelled"
    INCOMPLETE_SEQUENCE = "incomplete_sequence"
    NO_MAP_COVERAGE = "no_map_coverage"
    MAP_DISTORTED = "map_distorted"
    CRASH_OFF_ROAD = "crash_off_road"
    VERTICAL_GEOMETRY = "vertical_geometry"
    MAP_TOO_SMALL = "map_too_small"
    NO_FEASIBLE_STATE = "no_feasible_state"
    NO_COLLISION = "no_collision"
    NO_DEPARTURE = "no_departure"
    WRONG_SIDE = "wrong_side"
    NO_OVERTURN = "no_overturn"
    WRONG_LOCATION = "wrong_location"
    WRONG_PARTY = "wrong_party"
    WRONG_IMPACT = "wrong_impact"
    WRONG_SEQUENCE = "wrong_sequence"
    WRONG_ZONE = "wrong_zone"
    WRONG_DIRECTION = "wrong_direction"
    WRONG_SPEED = "wrong_speed"  # only under the rule set "strict"

    @property
    def stage(self) -> Stage:
        """Return the stage that rejects with this reason."""
        return _REASONS[self].stage

    @property
    def published_category(self) -> PublishedCategory:
        """Return the paper's category this reason is counted under."""
        return _REASONS[self].published_category

    @property
    def meaning(self) -> str:
        """Return its meaning for the crash, in a sentence."""
        return _REASONS[self].meaning

    @property
    def remedy(self) -> str:
        """Return the remedy, in a sentence."""
        return _REASONS[self].remedy


@dataclass(frozen=True)
class _ReasonFacts:
    stage: Stage
    published_category: PublishedCategory
    meaning: str
    remedy: str


_PAPER = PublishedCategory
_REASONS: dict[Reason, _ReasonFacts] = {
    Reason.NOT_RELEASED: _ReasonFacts(
        Stage.RAW_REPORT,
        _PAPER.NOT_IN_PAPER,
        "The source answers, but holds no report of this crash yet.",
        "Run it again after NHTSA's next release.",
    ),
    Reason.MALFORMED_REPORT: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.NOT_IN_PAPER,
        "The report cannot be read: it is not well-formed XML, or holds a code its element does not have in that year.",
        "Correct the file and ingest it again, or set crash.repair_malformed, which marks the record as repaired.",
    ),
    Reason.INCOMPLETE_LOCATION: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.INCOMPLETE_INFORMATION,
        "The report gives no position, or one outside the United States.",
        "Nothing: the place is not known.",
    ),
    Reason.INCOMPLETE_TOPOLOGY: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.INCOMPLETE_INFORMATION,
        "The report does not say whether the crash was at an intersection.",
        "Nothing: the kind of place is not known.",
    ),
    Reason.INCOMPLETE_TRAJECTORY: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.INCOMPLETE_INFORMATION,
        "No field of the report says how one of the vehicles moved, to which side it left the road, or where a person "
        "was.",
        "Nothing: the motion is not known.",
    ),
    Reason.INCOMPLETE_IMPACT: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.INCOMPLETE_INFORMATION,
        "No field of the report says on which side any of the vehicles was struck: nothing could judge a simulation.",
        "Nothing: no area of impact is known that has a clock position.",
    ),
    Reason.OUTSIDE_COHORT: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.NOT_IN_PAPER,
        "A filter of the settings leaves the crash out.",
        "Change crash.kinds, crash.vehicles or crash.filters if you want it in.",
    ),
    Reason.NOT_MODELLED: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.NOT_IN_PAPER,
        "The crash is of a kind that cannot be judged yet, such as one with a train; the detail names the event.",
        "Nothing: modelled are crashes in which vehicles touched each other, struck people or, having left the road, "
        "fixed objects, or overturned.",
    ),
    Reason.INCOMPLETE_SEQUENCE: _ReasonFacts(
        Stage.CRASH_RECORD,
        _PAPER.INCOMPLETE_INFORMATION,
        "The events of the report do not say which vehicles met, which vehicle struck whom, or which one left "
        "the road.",
        "Nothing: who met whom is not known.",
    ),
    Reason.NO_MAP_COVERAGE: _ReasonFacts(
        Stage.OSM_EXTRACT,
        _PAPER.NOT_IN_PAPER,
        "No map file covers the place, or the map has no drivable road there.",
        "Ingest a map that covers it (trace-dag ingest --maps).",
    ),
    Reason.MAP_DISTORTED: _ReasonFacts(
        Stage.ROAD_MAP,
        _PAPER.INCONSISTENT_LOCATION,
        "A gate of the road map does not hold: the map is not what OpenStreetMap says.",
        "Look at the gate in the table map_checks; often the OSM data there is damaged.",
    ),
    Reason.CRASH_OFF_ROAD: _ReasonFacts(
        Stage.ROAD_MAP,
        _PAPER.INCONSISTENT_LOCATION,
        "The reported point is not on a road of the map, nor near one that fits the report.",
        "Compare the point with the map; a newer map may have the road.",
    ),
    Reason.VERTICAL_GEOMETRY: _ReasonFacts(
        Stage.ROAD_MAP,
        _PAPER.VERTICAL_GEOMETRY,
        "A bridge or tunnel is near, and roads.elevation is off.",
        "Switch roads.elevation on (the default).",
    ),
    Reason.MAP_TOO_SMALL: _ReasonFacts(
        Stage.STATE_ESTIMATE,
        _PAPER.INCONSISTENT_LOCATION,
        "The map's data end so near to the crash that a vehicle would begin where no road is.",
        "Add the map file of the neighbouring area, and ingest again.",
    ),
    Reason.NO_FEASIBLE_STATE: _ReasonFacts(
        Stage.STATE_ESTIMATE,
        _PAPER.NOT_REPRODUCED,
        "No paths on this map bring the parties together as reported.",
        "Look at the map picture: often a lane or a side road is missing.",
    ),
    Reason.NO_COLLISION: _ReasonFacts(
        Stage.SIMULATION_LOG,
        _PAPER.NOT_REPRODUCED,
        "The parties do not touch in any simulated hypothesis, or the vehicle strikes no object.",
        "Watch the replay; the log says how near they came.",
    ),
    Reason.NO_DEPARTURE: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A vehicle strikes an object without leaving the carriageway, which the report says it left.",
        "Look at the map picture: often the carriageway is wider on the map, or a side street opens there.",
    ),
    Reason.WRONG_SIDE: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A vehicle leaves the road to another side than reported.",
        "Watch the replay; see the criterion departure_side.",
    ),
    Reason.NO_OVERTURN: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A vehicle that overturned by the report comes to rest on its wheels in every simulated hypothesis.",
        "Watch the replay: often the reported speed is too low for what the ground can do to the vehicle.",
    ),
    Reason.WRONG_LOCATION: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "The first contact is too far from the reported point, along the road where it is beside the road; or the "
        "vehicle leaves a street that the report does not name.",
        "See the criterion contact_distance, station_distance (verdict.max_contact_distance_m is the limit) or "
        "departed_street.",
    ),
    Reason.WRONG_PARTY: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "Other parties than reported touch first: another vehicle, or another person.",
        "Watch the replay; the contacts are in the simulation log.",
    ),
    Reason.WRONG_IMPACT: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A vehicle is struck at another place of its body than reported.",
        "See the criterion clock_error; verdict.max_clock_error_positions is the limit.",
    ),
    Reason.WRONG_SEQUENCE: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A reported contact does not happen, happens in another order, or parties touch that no event has touch.",
        "See the criteria strike, next_contact, unreported_contact and object_order.",
    ),
    Reason.WRONG_ZONE: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A person, a parked vehicle or an object is struck in another zone of the road than reported: beside it, say.",
        "See the criterion zone_error; verdict.max_zone_error_m is the limit.",
    ),
    Reason.WRONG_DIRECTION: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A vehicle or a person went another way than reported, or the two met at another angle.",
        "See the criteria direction_error, relation_error, course_error and compass_error.",
    ),
    Reason.WRONG_SPEED: _ReasonFacts(
        Stage.VERDICT,
        _PAPER.NOT_REPRODUCED,
        "A reported travel speed was not kept. Only the rule set strict rejects for it.",
        "See the criterion initial_speed_error; verdict.max_speed_error_rel is the limit.",
    ),
}


class Rejection(Exception):  # noqa: N818 - a rejection is an outcome, not an error
    """The crash is excluded for ``reason``; ``detail`` is one sentence that names what was measured.

    ``measured`` and ``threshold`` carry the number behind the sentence where there is one, in the unit the
    sentence states (metres, hours of the clock, vehicles, ...).
    """

    def __init__(
        self, reason: Reason, detail: str, *, measured: float | None = None, threshold: float | None = None
    ) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail
        self.measured = measured
        self.threshold = threshold

    def __reduce__(self) -> tuple[object, ...]:
        # Exceptions with keyword arguments do not survive a process pool without this.
        return (_rebuild_rejection, (self.reason, self.detail, self.measured, self.threshold))


def _rebuild_rejection(reason: Reason, detail: str, measured: float | None, threshold: float | None) -> Rejection:
    return Rejection(reason, detail, measured=measured, threshold=threshold)


class Failure(Exception):  # noqa: N818 - Dagster's word for it
    """A stage broke for a reason outside the crash: it must be repaired or retried, never counted."""


class TransientFailure(Failure):
    """A failure that may pass by itself (time-out, 429, 5xx, a lost worker): retried by policy.

    ``tried_again``: all attempts that the settings allow were made before it was raised.
    """

    def __init__(self, message: str, *, tried_again: bool = False) -> None:
        super().__init__(message)
        self.tried_again = tried_again


class BudgetSpent(Failure):
    """A service whose budget is spent."""


class DamagedFile(Failure):
    """A stored file that differs from what was written. ``found`` describes it, ``remedy`` repairs it."""

    def __init__(self, name: str, found: str, remedy: str = "") -> None:
        super().__init__(f"{name}: damaged: {found}" + (f"; {remedy}" if remedy else ""))
        self.name = name
        self.found = found
        self.remedy = remedy

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.name, self.found, self.remedy))

    def mended_by(self, remedy: str) -> DamagedFile:
        """Return the same damage with its remedy in the message."""
        return DamagedFile(self.name, self.found, remedy)


class UserError(Exception):
    """A request that cannot be met; the message names what was found, what was expected and what to do."""


class UserErrors(UserError):  # noqa: N818 - several of them
    """Several at once, each a line of its own."""

    def __init__(self, messages: Iterable[str]) -> None:
        self.messages = tuple(messages)
        super().__init__("; ".join(self.messages))

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.messages,))
