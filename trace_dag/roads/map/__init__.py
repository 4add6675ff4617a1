"""The road map: OpenDRIVE as plain types, its geometry, and queries.

Belongs here: what holds for any OpenDRIVE map, whoever made it. Does not belong here: OpenStreetMap.
"""
