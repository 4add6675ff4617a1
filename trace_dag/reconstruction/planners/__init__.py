"""Planners, each for one kind of event, as the first one of a crash or after the course so far.

Belongs here: one module per kind of event. Each plan has its parties and objects; the search simulates it.
"""
