"""From OpenStreetMap to an OpenDRIVE road map, and what that map can be asked.

Belongs here: the map and its queries (:mod:`trace_dag.roads.map`), the conversion (:mod:`trace_dag.roads.from_osm`),
the crash on it (:mod:`trace_dag.roads.crash_site`), its guarantees (:mod:`trace_dag.roads.gates`), and all of them
together (:mod:`trace_dag.roads.build`). Does not belong here: fetching or cutting OSM data (:mod:`trace_dag.osm`),
vehicles, Dagster.
"""
