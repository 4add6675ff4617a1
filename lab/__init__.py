"""Measures of the program: its speed, its robustness, and what its results are worth; not part of the wheel.

``python -m lab NAME`` runs one; without a name it lists them.
"""
