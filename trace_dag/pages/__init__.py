"""Pictures, crash pages, the index and replays, in the plan and in three dimensions.

Excluded: files for simulators (:mod:`trace_dag.scenario`), packages and releases (:mod:`trace_dag.export`).
"""
