"""Planners: how one kind of event can come about, as the first one of a crash or from the course so far.

Belongs here: one module per kind of event. Each plan names who and what takes part; the search simulates it.
"""
