"""OpenStreetMap data around a crash.

Belongs here: map sources (files, Overpass, the OSM API), one-pass extraction, pruning, the plain OSM types. Does
not belong here: roads as lanes, crashes, Dagster.
"""
