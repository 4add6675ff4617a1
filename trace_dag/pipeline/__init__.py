"""The seven stages of a crash, without Dagster.

Belongs here: the stage functions over storage, provenance and skipping, executors, the registry of cohorts. Does
not belong here: domain logic (in the domain packages) and Dagster (in assets and resources).
"""
