"""A crash in three dimensions, as glTF 2.0, for a replay's 3D view and ``--format glb``.

Belongs here: shapes of roads, vehicles, people and objects as triangles, and their motion as key frames. Does not
belong here: the page that shows it (``web/replay3d``), and views from above.
"""
