"""From police-reported crashes to runnable, judged crash scenarios on the real road."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.version import __version__

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    from trace_dag.reading.crashes import Crashes
    from trace_dag.reading.road_map import MadeMap

__all__ = ["__version__", "open", "road_map"]


def open(place: str | os.PathLike[str] | None = None) -> Crashes:
    """Return the crashes of a storage root, of a package or of a release, for Python.

    ``place`` is a root (a folder or a URL such as ``s3://bucket/folder``), or the folder or archive of a package or a
    release; the default is ``TRACE_DAG_ROOT``, or ``./trace_dag_home`` if that is not set. Data is read on first use,
    and nothing is changed. Raises :class:`trace_dag.common.errors.UserError` for any other kind of place::

    import trace_dag

    home = trace_dag.open("trace_dag_home") home.crashes # a pandas DataFrame home["2023-319003"].replay() # shown by a
    notebook trace_dag.open("2023-319003.zip").only.verdict
    """
    from trace_dag.reading.opening import open_place

    return open_place(place)


def road_map(
    osm: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | None = None,
    *,
    at: tuple[float, float] | None = None,
    radius_m: float = 400.0,
    box: tuple[float, float, float, float] | None = None,
    left_hand: bool = False,
) -> MadeMap:
    """Return the OpenStreetMap as OpenDRIVE, without a crash.

    The roads around a place, in a box, or of a whole small file.

    ``osm`` is a file or folder, or several; None asks Overpass, a public service. ``at``: latitude and longitude,
    WGS84, around which the map reaches ``radius_m``; or ``box``: west, south, east, north; neither takes the whole
    file. ``left_hand``: traffic keeps left. Raises :class:`trace_dag.common.errors.UserError` where there is no road,
    the file is no map, or the box has a side of more than 10 km::

        import trace_dag

        made = trace_dag.road_map("tempe-az.osm.pbf", at=(33.4255, -111.94))
        made.network.roads                  # what was made
        made.lanes                          # a pandas DataFrame with shapely shapes
        made.save("tempe")                  # map.xodr, map.json, map.png
    """
    from trace_dag.reading.road_map import make_map

    return make_map(osm, at=at, radius_m=radius_m, box=box, left_hand=left_hand)
