"""CARLA: its simulator as a back-end, its converter from OpenStreetMap, both by the extra ``carla``."""
