"""Stored results for Python: ``trace_dag.open`` and the objects that it returns.

Belongs here: crashes of a root, a package or a release as one mapping, with their tables, roads and pictures in common
Python types (pandas, Arrow, shapely, networkx, Pillow). Does not belong here: parsing, which is done by the packages
below, and making or changing anything.
"""
