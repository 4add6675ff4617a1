"""Estimates of the states before a crash: hypotheses, their search through the events, and their evidence.

``scene`` is the crash on its map, ``motion`` paths, manoeuvres and speeds, ``planners`` the plans for one kind of event
each, ``samples`` draws of unreported quantities. Excluded: verdicts, Dagster.
"""
