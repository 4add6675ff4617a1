"""Conversion of OpenStreetMap to a road map.

Belongs here: the conversion of tags and shapes of streets. Does not belong here: anything about a crash.
"""
