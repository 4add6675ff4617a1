"""Piecewise cubics over a road's ``s``: widths, lane offsets, elevation, and sums of them.

OpenDRIVE describes every quantity that varies along a road as cubics that each hold from their own ``s`` on
(ASAM OpenDRIVE 1.7, sections 8.4, 9.3 and 9.5.1). Sums of such profiles, such as the distance of a lane's centre from
the reference line, are piecewise cubics again, so they are added up once and then evaluated directly.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Self

import numpy as np

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import Cubic

_Coefficients = tuple[float, float, float, float]


class CubicProfile:
    """A piecewise cubic in ``s`` (metres along a road); before its beginning the first piece is continued."""

    __slots__ = ("_arrays", "constant", "knots_m", "pieces")

    def __init__(self, knots_m: Sequence[float], pieces: Sequence[_Coefficients]) -> None:
        self.knots_m = tuple(knots_m)
        self.pieces = tuple(pieces)
        self.constant: float | None = (
            self.pieces[0][0] if len(self.pieces) == 1 and self.pieces[0][1:] == (0.0, 0.0, 0.0) else None
        )
        self._arrays: tuple[FloatArray, FloatArray] | None = None

    @classmethod
    def of(cls, cubics: Iterable[Cubic], *, origin_m: float = 0.0) -> Self:
        """Return a profile of OpenDRIVE records whose ``s`` counts from ``origin_m``.

        Without records it is 0 everywhere.
        """
        ordered = list(cubics)
        if not ordered:
            return cls((origin_m,), ((0.0, 0.0, 0.0, 0.0),))
        if len(ordered) == 1:
            (only,) = ordered
            return cls((origin_m + only.s_m,), ((only.a, only.b, only.c, only.d),))
        ordered.sort(key=lambda cubic: cubic.s_m)
        return cls([origin_m + c.s_m for c in ordered], [(c.a, c.b, c.c, c.d) for c in ordered])

    @classmethod
    def weighted_sum(cls, terms: Iterable[tuple[float, CubicProfile]]) -> Self:
        """Return the sum of ``weight * profile`` over all terms."""
        profiles = [(weight, profile) for weight, profile in terms if weight]
        if not profiles:
            return cls((0.0,), ((0.0, 0.0, 0.0, 0.0),))
        if all(profile.constant is not None for _, profile in profiles):
            total = math.fsum(weight * profile.pieces[0][0] for weight, profile in profiles)
            return cls((profiles[0][1].knots_m[0],), ((total, 0.0, 0.0, 0.0),))
        knots = sorted({knot for _, profile in profiles for knot in profile.knots_m})
        pieces = []
        for knot in knots:
            shifted = [(weight, profile.coefficients_at(knot)) for weight, profile in profiles]
            a, b, c, d = (math.fsum(weight * each[k] for weight, each in shifted) for k in range(4))
            pieces.append((a, b, c, d))
        return cls(knots, pieces)

    def coefficients_at(self, s_m: float) -> _Coefficients:
        """Return coefficients of the piece valid at ``s_m``, with ``s_m`` as its origin."""
        index = max(bisect_right(self.knots_m, s_m) - 1, 0)
        a, b, c, d = self.pieces[index]
        u = s_m - self.knots_m[index]
        return (a + u * (b + u * (c + u * d)), b + u * (2 * c + 3 * u * d), c + 3 * u * d, d)

    def at(self, s_m: float) -> float:
        """Return the value at one ``s_m``."""
        return self.coefficients_at(s_m)[0] if self.constant is None else self.constant

    def slope(self, s_m: float) -> float:
        """Return the derivative with respect to ``s`` at one ``s_m``."""
        return self.coefficients_at(s_m)[1] if self.constant is None else 0.0

    def sample(self, s_m: FloatArray) -> FloatArray:
        """Return values at many ``s``, same shape."""
        if self.constant is not None:
            return np.full(s_m.shape, self.constant)
        u, pieces = self._located(s_m)
        return pieces[:, 0] + u * (pieces[:, 1] + u * (pieces[:, 2] + u * pieces[:, 3]))

    def sample_slope(self, s_m: FloatArray) -> FloatArray:
        """Return derivatives at many ``s``, same shape."""
        if self.constant is not None:
            return np.zeros(s_m.shape)
        u, pieces = self._located(s_m)
        return pieces[:, 1] + u * (2 * pieces[:, 2] + 3 * u * pieces[:, 3])

    def _located(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self._arrays is None:
            self._arrays = (np.array(self.knots_m), np.array(self.pieces))
        knots, pieces = self._arrays
        index = np.maximum(np.searchsorted(knots, s_m, side="right") - 1, 0)
        return s_m - knots[index], pieces[index]
