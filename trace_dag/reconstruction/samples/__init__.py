"""Draws of what a report leaves open, each simulated and weighed."""
