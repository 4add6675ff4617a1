"""From OpenStreetMap to an OpenDRIVE road map, and what that map can be asked.

Belongs here: the road network model and its queries (:mod:`network`), the conversion from OSM, the OpenDRIVE
writer and reader, elevation, placing the crash on the map, comparing map and report, and the map gates.
Does not belong here: fetching or cutting OSM data (:mod:`trace_dag.osm`), vehicles, Dagster.
"""
