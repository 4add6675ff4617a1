"""From police-reported fatal crashes to runnable, judged crash scenarios on the real road."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trace_dag.version import __version__

if TYPE_CHECKING:
    import os

    from trace_dag.reading.crashes import Crashes

__all__ = ["__version__", "open"]


def open(place: str | os.PathLike[str] | None = None) -> Crashes:
    """The crashes of a storage root, of a package or of a release, for Python.

    ``place`` is a root (a folder or a URL such as ``s3://bucket/folder``), or the folder or archive of a package or a
    release; without it ``TRACE_DAG_ROOT``, else ``./trace_dag_home``. Nothing is read before it is asked for, and
    nothing is changed. Raises :class:`trace_dag.errors.UserError` for any other kind of place::

        import trace_dag

        home = trace_dag.open("trace_dag_home")
        home.crashes                        # a pandas DataFrame
        home["2023-319003"].replay()        # shown by a notebook
        trace_dag.open("2023-319003.zip").only.verdict
    """
    from trace_dag.reading.opening import open_place

    return open_place(place)
