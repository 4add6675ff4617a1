"""Where the vehicles came from: hypotheses, the solver that turns one into states, estimators, checks.

Belongs here: candidates and manoeuvres, the impact configuration, speed profiles, the analytic and the LLM
estimator
and their comparison. Does not belong here: simulation, verdicts, Dagster.
"""
