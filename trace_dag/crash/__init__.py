"""Crash reports: where they come from, what they say, and whether they say enough.

Belongs here: report sources (CrashAPI, folder, FARS CSV), parsing, FARS code tables, the record types, completeness
rules, cohort selection, the summary in words. Does not belong here: maps, geometry of roads, Dagster.
"""
