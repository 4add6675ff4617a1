"""The verdict: metrics measure, rules judge.

Belongs here: measurements of a simulation log against a crash record, thresholds and rule sets, negative controls. Does
not belong here: simulating, estimating, Dagster.
"""
