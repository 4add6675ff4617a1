"""The verdict: metrics measure, rules judge.

Belongs here: what is measured on a simulation log against a crash record, thresholds and rule sets, negative
controls. Does not belong here: simulating, estimating, Dagster.
"""
