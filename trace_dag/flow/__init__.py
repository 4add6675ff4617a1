"""The seven stages of a crash and what runs them, without Dagster.

Belongs here: the contract of a stage, the stages, batches and workers, records of outcomes and what they say. Does not
belong here: which crashes there are (:mod:`trace_dag.flow.cohorts`), and what is made of many crashes together.
"""
