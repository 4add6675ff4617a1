"""Estimates of the states before a crash: hypotheses, their search through the events, and what supports them.

``scene`` is the crash on its map, ``motion`` paths, manoeuvres and speeds, ``planners`` the ways in which one kind of
event can come about, ``samples`` the draws of what a report leaves open. Excluded: verdicts, Dagster.
"""
