"""Vehicles around a crash, by a traffic simulator: volumes, routes, and motions."""
