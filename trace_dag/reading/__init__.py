"""Stored results for Python: ``trace_dag.open`` and the objects that it returns.

Belongs here: crashes of a root, a package or a release as one mapping, with their tables, roads and pictures in the
types that Python's users have (pandas, Arrow, shapely, networkx, Pillow). Does not belong here: reading any of it,
which the packages below do; making or changing anything.
"""
