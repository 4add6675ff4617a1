"""Verified crashes in the forms that other tools read, each an exporter: ``trace-dag export --format NAME``.

Belongs here: a module per form, which turns one crash into files. Does not belong here: which crashes are written and
where (:mod:`trace_dag.benchmark.export`); what a scenario package looks like (:mod:`trace_dag.scenario`).
"""
