"""From OpenStreetMap to a road map.

Belongs here: what tags and shapes of streets become. Does not belong here: anything about a crash.
"""
