"""A crash in three dimensions, as glTF 2.0: what a replay's 3D view shows and ``--format glb`` writes.

Belongs here: shapes of roads, vehicles, people and objects as triangles, and their motion as key frames. Does not
belong here: how a page shows it (``web/replay3d``), and what anything looks like from above.
"""
