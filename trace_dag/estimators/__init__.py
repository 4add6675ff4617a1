"""The estimators of the settings: each chooses by what a crash is reconstructed as, and may simulate on the way.

Belongs here: the classes that the settings name, and estimates that simulate on the way. How a single collision is
estimated, and how a language model is asked, is in :mod:`trace_dag.states`, which knows no simulator.
"""
