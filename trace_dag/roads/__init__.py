"""From OpenStreetMap to an OpenDRIVE road map, and queries of that map.

Belongs here: the map and its queries (:mod:`trace_dag.roads.map`), the conversion (:mod:`trace_dag.roads.from_osm`),
the crash on it (:mod:`trace_dag.roads.crash_site`), the checks it has to pass (:mod:`trace_dag.roads.gates`), and the
four together (:mod:`trace_dag.roads.build`). Does not belong here: fetching or cutting OSM data (:mod:`trace_dag.osm`),
vehicles, Dagster.
"""
