"""Families of crashes: a verified crash perturbed, and what of that is kept as a scenario for tests.

Belongs here: what a perturbation is and how it is drawn (:mod:`perturbation`), the motion it makes of a recorded one
(:mod:`motion`), and the criteria a variation has to meet (:mod:`family`). Does not belong here: which crashes, workers
and storage (:mod:`trace_dag.agents.families`), Dagster.
"""
