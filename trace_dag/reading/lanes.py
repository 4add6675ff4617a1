"""The lanes of a map as a table of shapely geometries, and as a networkx graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from trace_dag.common.errors import UserError
from trace_dag.roads.map.lane_shapes import LaneShape, lane_shapes
from trace_dag.roads.map.network import RoadNetwork

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd


def lane_table(network: RoadNetwork) -> pd.DataFrame:
    """Return a row per lane, indexed by ``lane`` (:class:`trace_dag.roads.map.model.LaneRef`), local frame, metres.

    Columns: ``type``, ``speed_mps`` (its limit, or NaN), ``junction_id`` (None outside junctions), ``length_m``,
    ``centre`` (shapely ``LineString`` with heights, in the direction of travel), ``surface`` (``Polygon``),
    ``predecessors`` and ``successors`` (lists of lanes), ``left`` and ``right`` (the drivable lane directly beside it,
    or None).
    """
    import pandas as pd

    shapes = lane_shapes(network)
    rows = [_row(shape) for shape in shapes]
    index = pd.Index([shape.ref for shape in shapes], name="lane", tupleize_cols=False)
    return pd.DataFrame(rows, index=index, columns=_COLUMNS)


def lane_graph(network: RoadNetwork) -> nx.DiGraph[Any]:
    """Return the drivable lanes as a directed graph of networkx, the extra ``graph``.

    A node per lane (:class:`trace_dag.roads.map.model.LaneRef`) with the columns of :func:`lane_table` that are not
    lanes themselves. Edges have a ``kind``: ``successor`` for the next lane along the road, weighted with the
    ``length_m`` of the earlier lane; ``left`` and ``right`` for an adjacent lane in the same direction. Raises
    :class:`UserError` without networkx.
    """
    try:
        import networkx as nx
    except ImportError as error:
        raise UserError("a graph of lanes needs networkx: pip install 'trace-dag[graph]'") from error

    graph: nx.DiGraph[Any] = nx.DiGraph()
    shapes = lane_shapes(network, drivable_only=True)
    for shape in shapes:
        row = _row(shape)
        graph.add_node(shape.ref, **{name: row[name] for name in _COLUMNS if name not in _OTHER_LANES})
    for shape in shapes:
        for successor in shape.successors:
            graph.add_edge(shape.ref, successor, kind="successor", length_m=shape.length_m)
        for kind, beside, same_way in (
            ("left", shape.left, shape.left_same_way),
            ("right", shape.right, shape.right_same_way),
        ):
            if beside is not None and same_way:
                graph.add_edge(shape.ref, beside, kind=kind, length_m=0.0)
    return graph


_COLUMNS = (
    "type",
    "speed_mps",
    "junction_id",
    "length_m",
    "centre",
    "surface",
    "predecessors",
    "successors",
    "left",
    "right",
)
_OTHER_LANES = frozenset({"predecessors", "successors", "left", "right"})


def _row(shape: LaneShape) -> dict[str, Any]:
    import numpy as np
    import shapely

    return {
        "type": str(shape.type),
        "speed_mps": shape.speed_mps,
        "junction_id": shape.junction_id,
        "length_m": shape.length_m,
        "centre": shapely.LineString(shape.centre_m),
        "surface": shapely.Polygon(np.concatenate([shape.left_m, shape.right_m[::-1]])),
        "predecessors": list(shape.predecessors),
        "successors": list(shape.successors),
        "left": shape.left,
        "right": shape.right,
    }
