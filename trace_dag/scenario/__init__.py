"""Files for simulators: OpenSCENARIO, the surroundings in OpenDRIVE, courses and cases to drive in.

Excluded: pictures and pages (:mod:`trace_dag.pages`), packages (:mod:`trace_dag.export`).
"""
