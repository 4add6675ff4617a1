"""Cohorts, the sources of their crashes, and the public services behind those.

Belongs here: choosing, registering and listing crashes. Does not belong here: running them (:mod:`trace_dag.flow`).
"""
