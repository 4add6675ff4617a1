"""What leaves the project: pictures, replays, OpenSCENARIO, scenario packages, the benchmark page.

Belongs here: everything that presents or exports a crash. Does not belong here: deciding anything about it.
"""
