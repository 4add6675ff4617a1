"""The guarantees of a road map, measured on the stored file."""
