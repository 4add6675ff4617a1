"""Agents in the loop: a verified crash with someone else at one of its wheels, and what came of it.

Belongs here: what an agent sees and does (:mod:`agents`, :mod:`observation`), how it is seated in a
simulation (:mod:`loop`), how the others move (:mod:`traffic`, :mod:`persistent`), the agents that every other is
compared with (:mod:`baselines`), and what a run amounts to beside the recorded crash (:mod:`metrics`). Does not belong
here: simulating (:mod:`trace_dag.simulation`), which crashes are evaluated and where results are kept
(:mod:`trace_dag.agents.evaluations`), Dagster.

Beyond the end of its recorded motion everybody goes straight on at its last speed; from its first contact on physics
alone moves it.
"""
