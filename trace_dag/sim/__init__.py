"""Simulation: a back-end takes a road map and participants and returns a log.

Belongs here: the back-end contract, vehicle and driver models, the embedded MuJoCo back-end, the CARLA back-end.
Does not belong here: choosing hypotheses, judging the result, Dagster.
"""
