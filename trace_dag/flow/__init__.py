"""The seven stages of a crash and what runs them, without Dagster.

Belongs here: the contract of a stage, the stages, batches and workers, and records of outcomes. Does not belong here:
the registration of crashes (:mod:`trace_dag.flow.cohorts`), and products of many crashes together.
"""
