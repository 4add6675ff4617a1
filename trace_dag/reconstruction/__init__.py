"""Estimates that simulate on the way: the search through a crash's events, and a planner for each kind of event.

Belongs here: the estimators that the settings name (``analytic``, ``llm``), the search, and in ``planners`` how one
kind of event can come about. How a first contact is solved for, without a simulator, is in :mod:`trace_dag.states`.
"""
