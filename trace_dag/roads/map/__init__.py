"""The road map: OpenDRIVE as plain types, its geometry, and queries.

Belongs here: everything common to all OpenDRIVE maps, whoever made them. Does not belong here: OpenStreetMap.
"""
