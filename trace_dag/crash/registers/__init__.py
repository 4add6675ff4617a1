"""Crash tables of states, cities and other countries, each read by a mapping: a TOML file and no code.

Belongs here: the contents of a mapping, reading a table by one, and the mappings of the package. A table that needs
more than columns and tables of values is a source of its own (entry points of the group ``trace_dag.report_sources``).
"""
