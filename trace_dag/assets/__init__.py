"""Dagster assets, checks, jobs, sensors and schedules: thin wrappers over the flow.

Belongs here: one small module per group. Does not belong here: work of any kind.
"""
