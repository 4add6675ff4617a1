"""The tables and views of a warehouse."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class Rows(Enum):
    """Subjects of the rows of a table."""

    OF_ONE = auto()
    """Each belongs to one crash and says nothing of others: a changed crash changes its own rows alone."""
    OF_ALL = auto()


TABLES: Final[Mapping[str, Rows]] = {
    "coverage_classes": Rows.OF_ALL,
    "crash_kinds": Rows.OF_ALL,
    "codes": Rows.OF_ALL,
    "crashes": Rows.OF_ONE,
    "vehicles": Rows.OF_ONE,
    "events": Rows.OF_ONE,
    "non_motorists": Rows.OF_ONE,
    "quotations": Rows.OF_ONE,
    "stage_outcomes": Rows.OF_ONE,
    "stage_history": Rows.OF_ONE,
    "artefacts": Rows.OF_ONE,
    "maps": Rows.OF_ONE,
    "map_checks": Rows.OF_ONE,
    "estimates": Rows.OF_ONE,
    "estimated_states": Rows.OF_ONE,
    "simulations": Rows.OF_ONE,
    "contacts": Rows.OF_ONE,
    "estimate_intervals": Rows.OF_ONE,
    "verdict_criteria": Rows.OF_ONE,
    "verdicts": Rows.OF_ALL,
    "judged_crashes": Rows.OF_ALL,
    "pedestrians": Rows.OF_ALL,
    "catalogue": Rows.OF_ALL,
    "support": Rows.OF_ONE,
    "reservations": Rows.OF_ONE,
    "sight_lines": Rows.OF_ONE,
    "verdict_changes": Rows.OF_ALL,
    "fatality_plausibility": Rows.OF_ALL,
    "doubtful_places": Rows.OF_ALL,
    "injury_risk": Rows.OF_ALL,
    "failures": Rows.OF_ONE,
    "funnel": Rows.OF_ALL,
    "cohort_funnel": Rows.OF_ALL,
    "funnel_by_kind": Rows.OF_ALL,
    "failure_reasons": Rows.OF_ALL,
    "usable_information": Rows.OF_ALL,
    "coverage": Rows.OF_ALL,
    "coverage_cross": Rows.OF_ALL,
    "coverage_by_kind": Rows.OF_ALL,
    "person_crash_groups": Rows.OF_ALL,
    "cohort_gaps": Rows.OF_ALL,
    "run_summary": Rows.OF_ALL,
    "negative_controls": Rows.OF_ALL,
    "perturbed_controls": Rows.OF_ALL,
    "evaluations": Rows.OF_ALL,
    "leaderboard": Rows.OF_ALL,
    "leaderboard_by_class": Rows.OF_ALL,
    "agent_probabilities": Rows.OF_ALL,
    "variations": Rows.OF_ALL,
    "traffic": Rows.OF_ALL,
    "estimator_comparison": Rows.OF_ALL,
    "warehouse_build": Rows.OF_ALL,
}
"""All of them by name, in the order in which they are made, each by its ``.sql`` file."""
