"""Dagster resources: adapters that build plain objects from configuration.

Belongs here: resources. Does not belong here: work of any kind.
"""
