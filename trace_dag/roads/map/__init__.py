"""The road map: OpenDRIVE as plain types, its geometry, and the questions later stages ask of it.

Belongs here: what holds for any OpenDRIVE map, whoever made it. Does not belong here: OpenStreetMap.
"""
