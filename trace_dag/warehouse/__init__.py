"""The DuckDB warehouse.

Belongs here: its build from the artefacts and the SQL files of its tables and views. Does not belong here:
computing anything that is not in an artefact.
"""
