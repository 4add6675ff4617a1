"""Vehicles around a crash, by a traffic simulator: volumes, routes, and the motion of everybody who is no party."""
