"""Vectorised sampling of many lines and profiles at many places: numpy takes hardly longer for all than for one.

The numbers are those of :class:`~trace_dag.roads.map.reference_line.ReferenceLine` and
:class:`~trace_dag.roads.map.cubic_profile.CubicProfile`, to the bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from trace_dag.roads.map.curves import along_arcs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.cubic_profile import CubicProfile
    from trace_dag.roads.map.reference_line import ReferenceLine

    IntArray = NDArray[np.intp]


class Stations(NamedTuple):
    """Stations ``s_m`` on several lines or lanes, concatenated, (n,), with the owner of each.

    It also has the index of the first station of each line, and the number of all.
    """

    s_m: FloatArray
    owner: IntArray
    first: IntArray

    @property
    def slices(self) -> list[slice]:
        """Return the places of each line's stations."""
        ends = [*self.first[1:].tolist(), len(self.s_m)]
        return [slice(start, end) for start, end in zip(self.first.tolist(), ends, strict=True)]


def stations_between(begin_m: FloatArray, end_m: FloatArray, step_m: float) -> Stations:
    """Return evenly spaced stations of several stretches, (n,) each, at most ``step_m`` apart.

    Both ends are included.

    >>> stations_between(np.array([0.0, 10.0]), np.array([5.0, 11.0]), 2.5).s_m.tolist()
    [0.0, 2.5, 5.0, 10.0, 11.0]
    """
    pieces = np.maximum(np.ceil((end_m - begin_m) / step_m - 1e-9), 1.0).astype(np.intp)
    last = np.cumsum(pieces + 1) - 1
    first = last - pieces
    owner = np.repeat(np.arange(len(pieces)), pieces + 1)
    s_m = begin_m[owner] + (np.arange(len(owner)) - first[owner]) * ((end_m - begin_m) / pieces)[owner]
    s_m[last] = end_m
    return Stations(s_m, owner, first)


def sample_profiles(profiles: Sequence[CubicProfile], stations: Stations) -> FloatArray:
    """Return values of several profiles, each at its stations, (n,).

    >>> from trace_dag.roads.map.cubic_profile import CubicProfile
    >>> constant, rising = (CubicProfile([0.0], [(3.5, slope, 0.0, 0.0)]) for slope in (0.0, 0.5))
    >>> sample_profiles([constant, rising], stations_between(np.zeros(2), np.full(2, 4.0), 2.0)).tolist()
    [3.5, 3.5, 3.5, 3.5, 4.5, 5.5]
    """
    values = np.array([profile.pieces[0][0] for profile in profiles])[stations.owner]
    for profile, where in zip(profiles, stations.slices, strict=True):
        if profile.constant is None:
            values[where] = profile.sample(stations.s_m[where])
    return values


def sample_reference_lines(lines: Sequence[ReferenceLine], stations: Stations) -> FloatArray:
    """Return x, y (metres), heading (radians) and curvature (1/m) of several lines, each at its stations, (n, 4).

    Headings are continuous along each.
    """
    lengths_m = np.array([line.length_m for line in lines])
    inside = np.minimum(np.maximum(stations.s_m, 0.0), lengths_m[stations.owner])
    numbers = {line: number for number, line in enumerate(dict.fromkeys(lines))}
    table = np.concatenate([line.table for line in numbers], axis=1)
    sizes = np.array([len(line.elements) for line in numbers])
    first = np.cumsum(sizes) - sizes
    of_line = np.array([numbers[line] for line in lines])[stations.owner]
    at = first[of_line]
    for step in range(1, int(sizes.max(initial=0))):  # past each piece that ends before the station
        starts_m = np.where(step < sizes, table[0][np.minimum(first + step, table.shape[1] - 1)], np.inf)
        at += inside >= starts_m[of_line]
    start, x, y, heading, curvature = table[:, at]
    out = np.empty((len(at), 4))
    out[:, 0], out[:, 1], out[:, 2] = along_arcs(x, y, heading, inside - start, curvature)
    out[:, 3] = curvature
    beyond = stations.s_m - inside
    if beyond.any():
        out[:, 0] += beyond * np.cos(out[:, 2])
        out[:, 1] += beyond * np.sin(out[:, 2])
    steps = np.abs(np.diff(out[:, 2]))
    steps[stations.first[1:] - 1] = 0.0
    slices = stations.slices
    turned = set(stations.owner[:-1][steps >= np.pi].tolist())
    for number in turned | {number for number, line in enumerate(lines) if line.has_cubics}:
        out[slices[number]] = lines[number].sample(stations.s_m[slices[number]])
    return out
