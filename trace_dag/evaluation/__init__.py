"""Agents in the loop: a verified crash with someone else at one of its wheels, and what came of it.

Belongs here: what an agent sees and does (:mod:`agents`, :mod:`observation`, :mod:`lane_map`), how it is seated in a
simulation (:mod:`loop`), the agents that every other is compared with (:mod:`baselines`), and what a run amounts to
beside the recorded crash (:mod:`metrics`, :mod:`outcome`). Does not belong here: simulating (:mod:`trace_dag.sim`),
which crashes are evaluated and where results are kept (:mod:`trace_dag.studies.evaluations`), Dagster.

Participants other than the agent's follow the motion recorded for them, whatever the agent does, and beyond its end
go straight on at their last speed; from their first contact on physics alone moves them.
"""
