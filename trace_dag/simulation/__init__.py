"""Simulation: a back-end takes a road map and participants and returns a log.

Included: participants and fixed objects as types, the back-end contract, vehicle and driver models, the embedded MuJoCo
back-end. Excluded: choosing hypotheses, judging the result, CARLA (:mod:`trace_dag.carla`), Dagster.
"""
