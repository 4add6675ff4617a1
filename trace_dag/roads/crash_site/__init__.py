"""The crash on the road map: where it is, whether map and report agree, and what the report adds to the map."""
