"""The output of the project: pictures, replays, OpenSCENARIO, scenario packages, pages.

Belongs here: everything that presents or exports a crash. Does not belong here: decisions about it.
"""
