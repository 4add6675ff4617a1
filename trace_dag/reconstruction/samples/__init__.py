"""Draws of unreported quantities, each simulated and weighed."""
