"""The crash on the road map: its place, the agreement of map and report, and the report's additions to the map."""
